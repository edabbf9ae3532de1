#include "boards/psoc4/flash_rows.h"

#include <string.h>

#include "boards/psoc4/regs/srom.h"
#include "generated/taxel_bootloader.h"
#include "part/cpuss.h"

#define WORDS (TAXEL_BOOT_ROW_SIZE / 4u)
#define CLOCK_WORDS 6u

/* ROM calls of this part: the clocks are saved, set for the flash, and restored. Source: manufacturer's public flash
 * driver. */
#define SROM_OPCODE_CLOCK_CONFIGURE 0x15u
#define SROM_OPCODE_CLOCK_SAVE 0x16u
#define SROM_OPCODE_CLOCK_RESTORE 0x17u

/* Parameters of the ROM: keys, then number of bytes minus 1 or an address, then the bytes. */
struct parameters {
    uint32_t keys;
    uint32_t second;
    uint32_t words[WORDS];
};

/* Call function number `opcode` of the chip's ROM; `argument` goes into its register. The result of the ROM is ignored:
 * the caller reads the row back. */
__attribute__((noinline)) static void call(uint32_t argument, uint32_t opcode)
{
    CPUSS->sysarg = argument;
    CPUSS->sysreq = CPUSS_SYSREQ_START | opcode;
    __asm__ volatile("nop\n\tnop\n\tnop" ::: "memory"); /* the ROM runs here, in an NMI, and reads the parameters */
}

/* Call a function of the ROM whose parameters are in RAM. `high`: bits 16 to 31 of the first word; `second`:
 * second word. */
static void call_with(struct parameters *parameters, uint32_t opcode, uint32_t high, uint32_t second)
{
    parameters->keys = SROM_PARAMETERS(opcode, high);
    parameters->second = second;
    call((uint32_t)(uintptr_t)parameters, opcode);
}

/* Erase and write one flash row of TAXEL_BOOT_ROW_SIZE bytes by calls of the ROM, with interrupts off. The processor
 * stops until the write has ended. SysTick counts with the clock of the write, so that the clock of the program loses a
 * part of this time (confirm). */
void flash_rows_write(uint16_t row, const uint8_t *bytes)
{
    struct parameters parameters;
    uint32_t clocks[CLOCK_WORDS];
    const uint32_t clocks_address = (uint32_t)(uintptr_t)clocks;
    memcpy(parameters.words, bytes, sizeof parameters.words);
    call_with(&parameters, SROM_OPCODE_LOAD_LATCH, 0, TAXEL_BOOT_ROW_SIZE - 1u);
    call_with(&parameters, SROM_OPCODE_CLOCK_SAVE, 0, clocks_address);
    call(SROM_PARAMETERS(SROM_OPCODE_CLOCK_CONFIGURE, 0), SROM_OPCODE_CLOCK_CONFIGURE);
    call_with(&parameters, SROM_OPCODE_WRITE_ROW, row, 0);
    call_with(&parameters, SROM_OPCODE_CLOCK_RESTORE, 0, clocks_address);
}
