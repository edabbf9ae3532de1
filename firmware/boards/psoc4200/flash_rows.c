#include "boards/psoc4200/flash_rows.h"

#include <string.h>

#include "boards/psoc4200/regs/cpuss.h"
#include "boards/psoc4200/regs/srom.h"
#include "boards/psoc4200/regs/srss.h"
#include "generated/taxel_bootloader.h"

#define WORDS (TAXEL_BOOT_ROW_SIZE / 4u)

/* What the ROM reads: keys, number of bytes less 1, then the bytes. */
struct parameters {
    uint32_t keys;
    uint32_t last;
    uint32_t words[WORDS];
};

/* What the ROM answers is not looked at: those who write a row read it back. */
__attribute__((noinline)) static void call(struct parameters *parameters, uint32_t opcode, uint32_t high)
{
    parameters->keys = SROM_PARAMETERS(opcode, high);
    CPUSS->sysarg = (uint32_t)(uintptr_t)parameters;
    CPUSS->sysreq = CPUSS_SYSREQ_START | opcode;
    __asm__ volatile("nop\n\tnop\n\tnop" ::: "memory"); /* the NMI comes here, and the ROM reads the parameters */
}

void flash_rows_write(uint16_t row, const uint8_t *bytes)
{
    struct parameters parameters;
    uint32_t sum = 0;
    uint32_t *last = parameters.words;
    parameters.last = TAXEL_BOOT_ROW_SIZE - 1u;
    const uint32_t imo_config = CLK->imo_config; /* the ROM may leave the oscillator's settings changed */
    memcpy(parameters.words, bytes, sizeof parameters.words);
    for (unsigned i = 0; i < WORDS; i++) {
        sum += parameters.words[i];
        last = parameters.words[i] ? &parameters.words[i] : last;
    }
    /* Rows whose words add up to zero, unless they are all zeros, are not written reliably (the maker's flash library
     * mends it in this way): such a row is written without its last word that is not zero, and that word is then
     * programmed on its own. */
    const uint32_t left_out = sum ? 0 : *last;
    if (left_out) {
        *last = 0;
    }
    call(&parameters, SROM_OPCODE_LOAD_LATCH, 0);
    call(&parameters, SROM_OPCODE_WRITE_ROW, row);
    if (left_out) {
        memset(parameters.words, 0, sizeof parameters.words);
        *last = left_out;
        call(&parameters, SROM_OPCODE_LOAD_LATCH, 0);
        call(&parameters, SROM_OPCODE_PROGRAM_ROW, row);
    }
    CLK->imo_config = imo_config;
}
