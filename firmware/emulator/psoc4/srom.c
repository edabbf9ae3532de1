/* System calls of the supervisory ROM that write flash (boards/psoc4/regs/srom.h). On silicon the ROM code runs in
 * an NMI; the model performs the call at once and stalls the processor for its duration. */
#include <string.h>

#include "emulator/psoc4/internal.h"

#define LOAD_LATCH 0x04u
#define WRITE_ROW 0x05u
#define PROGRAM_ROW 0x06u
#define CLOCK_CONFIGURE 0x15u /* PSoC 4100S: clocks for a write; its keys are in SYSARG itself */
#define CLOCK_SAVE 0x16u
#define CLOCK_RESTORE 0x17u
#define CLOCK_BYTES 24u
#define KEY_1 0xB6u
#define KEY_2(opcode) (0xD3u + (opcode))
#define SUCCEEDED 0xA0000000u
#define BAD_ADDRESS 0xF0000003u /* (confirm the error code) */
#define BAD_KEY 0xF0000005u
#define BAD_CLOCK 0xF0000012u
#define CALL_CYCLES 300u  /* estimated duration of the ROM code */
#define PARAMETER_SIZE 8u /* bytes of parameters before the data to load */

/* Return a pointer to the emulated RAM at `address`, or NULL if the `size` bytes from there are not all in RAM. */
static const uint8_t *ram_at(const struct psoc *psoc, uint32_t address, uint32_t size)
{
    const uint32_t offset = address - PSOC_RAM_BASE;
    const uint32_t ram_size = psoc_family(psoc)->ram_size;
    return offset < ram_size && size <= ram_size - offset ? psoc->ram + offset : NULL;
}

/* Read a 32-bit number of the emulated program from 4 bytes. */
static uint32_t read_word(const uint8_t *bytes)
{
    uint32_t value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

/* Execute the ROM call "load latch": copy bytes from RAM into the page latch. The parameters at `address` are: word 0
 * (`first`: keys in the low half, above them the byte offset in the latch and the flash macro, which must be 0), word 1
 * (number of bytes minus 1), then the bytes. Returns the status word. */
static uint32_t load_latch(struct psoc *psoc, uint32_t first, uint32_t address)
{
    const uint8_t *parameters = ram_at(psoc, address, PARAMETER_SIZE);
    const uint32_t offset = first >> 16 & 0xFFu, count = parameters ? read_word(parameters + 4) + 1u : 0u;
    const uint8_t *bytes = ram_at(psoc, address, PARAMETER_SIZE + count);
    if (!parameters || !bytes || first >> 24 || count > FLASH_ROW_SIZE || offset + count > FLASH_ROW_SIZE) {
        return BAD_ADDRESS;
    }
    memcpy(psoc->cpuss.latch + offset, bytes + PARAMETER_SIZE, count);
    return SUCCEEDED;
}

/* Execute the ROM call "write row" (with erase) or "program row" (bits can only be set): write the page latch to a
 * flash row. Adds the cycles for which the processor stops to *stall. Returns the status word. */
static uint32_t write_row(struct psoc *psoc, uint32_t row, bool erases, uint64_t cycle, uint32_t *stall)
{
    struct flash *flash = psoc->config.flash;
    uint8_t bytes[FLASH_ROW_SIZE];
    if (row >= psoc->config.part->flash_size / FLASH_ROW_SIZE) {
        return BAD_ADDRESS;
    }
    if (psoc_family(psoc)->configures_flash_clock && !psoc->cpuss.clock_is_for_flash) {
        return BAD_CLOCK;
    }
    for (unsigned i = 0; i < FLASH_ROW_SIZE; i++) {
        bytes[i] = (uint8_t)(psoc->cpuss.latch[i] | (erases ? 0u : flash->bytes[row * FLASH_ROW_SIZE + i]));
    }
    if (psoc->config.deviations.writes_no_flash) {
        return SUCCEEDED;
    }
    const vtime end = flash_write_row(flash, (uint16_t)row, bytes, psoc_time(psoc, cycle));
    cortex_m0_memory_changed(&psoc->cpu, row * FLASH_ROW_SIZE, FLASH_ROW_SIZE);
    memset(psoc->cpuss.latch, 0, sizeof psoc->cpuss.latch);
    *stall += (uint32_t)(psoc_cycle(psoc, end) - cycle);
    psoc_end_run(psoc); /* a power cut may be scheduled for this write */
    return SUCCEEDED;
}

/* Execute a ROM call of a PSoC 4100S that saves, sets or restores the clocks. address: of the parameters, the second of
 * which is the address of the saved clocks. The model keeps its clocks, because the processor does not run meanwhile.
 * Returns the status word. */
static uint32_t change_clock(struct psoc *psoc, uint32_t opcode, uint32_t address)
{
    if (opcode != CLOCK_CONFIGURE) {
        const uint8_t *parameters = ram_at(psoc, address, PARAMETER_SIZE);
        if (!parameters || !ram_at(psoc, read_word(parameters + 4), CLOCK_BYTES)) {
            return BAD_ADDRESS;
        }
    }
    psoc->cpuss.clock_is_for_flash = opcode == CLOCK_CONFIGURE;
    return SUCCEEDED;
}

/* Return whether the chip has a ROM call. */
static bool has_call(const struct psoc *psoc, uint32_t opcode)
{
    return opcode == LOAD_LATCH || opcode == WRITE_ROW || opcode == PROGRAM_ROW ||
           (psoc_family(psoc)->configures_flash_clock && opcode >= CLOCK_CONFIGURE && opcode <= CLOCK_RESTORE);
}

/* Execute a call of the ROM with the parameters at the address in SYSARG, which receives the status word. The call
 * CLOCK_CONFIGURE has its only parameter word in SYSARG itself. Returns the number of cycles for which the processor
 * stops; 0 after the report of an unknown call. */
uint32_t psoc_srom_call(struct psoc *psoc, uint32_t opcode, uint64_t cycle)
{
    const uint32_t address = psoc->cpuss.sysarg;
    const uint8_t *parameters = ram_at(psoc, address, PARAMETER_SIZE);
    const uint32_t in_memory = parameters ? read_word(parameters) : 0u;
    const uint32_t first = opcode == CLOCK_CONFIGURE ? address : in_memory;
    uint32_t stall = CALL_CYCLES, status;
    if (!has_call(psoc, opcode)) {
        psoc_report_unmodelled(psoc, "requests ROM call", opcode);
        return 0;
    }
    if ((first & 0xFFFFu) != (KEY_2(opcode) << 8 | KEY_1)) {
        status = BAD_KEY;
    } else if (opcode == LOAD_LATCH) {
        status = load_latch(psoc, first, address);
    } else if (opcode >= CLOCK_CONFIGURE) {
        status = change_clock(psoc, opcode, address);
    } else {
        status = write_row(psoc, first >> 16, opcode == WRITE_ROW, cycle, &stall);
    }
    psoc->cpuss.sysarg = status;
    return stall;
}
