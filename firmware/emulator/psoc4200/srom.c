/* System calls of the supervisory ROM that write flash (boards/psoc4200/regs/srom.h). On silicon the ROM code runs in
 * an NMI; the model performs the call at once and stalls the processor for its duration. */
#include <string.h>

#include "emulator/psoc4200/internal.h"

#define LOAD_LATCH 0x04u
#define WRITE_ROW 0x05u
#define PROGRAM_ROW 0x06u
#define KEY_1 0xB6u
#define KEY_2(opcode) (0xD3u + (opcode))
#define SUCCEEDED 0xA0000000u
#define BAD_ADDRESS 0xF0000003u /* (confirm the error code) */
#define BAD_KEY 0xF0000005u
#define CALL_CYCLES 300u  /* estimated duration of the ROM code */
#define PARAMETER_SIZE 8u /* bytes of parameters before the data to load */

/* Return a pointer to the emulated RAM at `address`, or NULL if the `size` bytes from there are not all in RAM. */
static const uint8_t *ram_at(const struct psoc *psoc, uint32_t address, uint32_t size)
{
    const uint32_t offset = address - PSOC_RAM_BASE;
    return offset < PSOC_RAM_SIZE && size <= PSOC_RAM_SIZE - offset ? psoc->ram + offset : NULL;
}

/* Read a 32-bit number of the emulated program from 4 bytes. */
static uint32_t read_word(const uint8_t *bytes)
{
    uint32_t value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

/* Execute the ROM call "load latch": copy bytes from RAM (`address`) into the page latch, from the byte offset in the
 * first parameter word on. Returns the status word. */
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

/* Execute a call of the ROM with the parameters at the address in SYSARG, which receives the status word. Returns the
 * number of cycles for which the processor stops; 0 after the report of an unknown call. */
uint32_t psoc_srom_call(struct psoc *psoc, uint32_t opcode, uint64_t cycle)
{
    const uint32_t address = psoc->cpuss.sysarg;
    const uint8_t *parameters = ram_at(psoc, address, PARAMETER_SIZE);
    const uint32_t first = parameters ? read_word(parameters) : 0u;
    uint32_t stall = CALL_CYCLES, status;
    if (opcode != LOAD_LATCH && opcode != WRITE_ROW && opcode != PROGRAM_ROW) {
        psoc_report_unmodelled(psoc, "requests ROM call", opcode);
        return 0;
    }
    if ((first & 0xFFFFu) != (KEY_2(opcode) << 8 | KEY_1)) {
        status = BAD_KEY;
    } else if (opcode == LOAD_LATCH) {
        status = load_latch(psoc, first, address);
    } else {
        status = write_row(psoc, first >> 16, opcode == WRITE_ROW, cycle, &stall);
    }
    psoc->cpuss.sysarg = status;
    return stall;
}
