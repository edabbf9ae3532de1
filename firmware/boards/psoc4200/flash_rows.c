#include "boards/psoc4/flash_rows.h"

#include <string.h>

#include "part/cpuss.h"
#include "boards/psoc4/regs/srom.h"
#include "part/srss.h"
#include "generated/taxel_bootloader.h"

#define WORDS (TAXEL_BOOT_ROW_SIZE / 4u)

/* Parameters of the ROM: keys, number of bytes minus 1, then the bytes. */
struct parameters {
    uint32_t keys;
    uint32_t last;
    uint32_t words[WORDS];
};

/* Call function number `opcode` of the chip's ROM with the parameters in RAM; `high` is an argument of the
 * function. The result of the ROM is ignored: the caller reads the row back. */
__attribute__((noinline)) static void call(struct parameters *parameters, uint32_t opcode, uint32_t high)
{
    parameters->keys = SROM_PARAMETERS(opcode, high);
    CPUSS->sysarg = (uint32_t)(uintptr_t)parameters;
    CPUSS->sysreq = CPUSS_SYSREQ_START | opcode;
    __asm__ volatile("nop\n\tnop\n\tnop" ::: "memory"); /* the ROM runs here, in an NMI, and reads the parameters */
}

/* Erase and write one flash row of TAXEL_BOOT_ROW_SIZE bytes by calls of the ROM, with interrupts off. The processor
 * stops until the write has ended. */
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
    /* Rows whose words add up to zero, unless they are all zeros, are not written reliably. As in the manufacturer's
     * flash library, such a row is written without its last non-zero word, and that word is then programmed
     * separately. */
    const uint32_t omitted_word = sum ? 0 : *last;
    if (omitted_word) {
        *last = 0;
    }
    call(&parameters, SROM_OPCODE_LOAD_LATCH, 0);
    call(&parameters, SROM_OPCODE_WRITE_ROW, row);
    if (omitted_word) {
        memset(parameters.words, 0, sizeof parameters.words);
        *last = omitted_word;
        call(&parameters, SROM_OPCODE_LOAD_LATCH, 0);
        call(&parameters, SROM_OPCODE_PROGRAM_ROW, row);
    }
    CLK->imo_config = imo_config;
}
