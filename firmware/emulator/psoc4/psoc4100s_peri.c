/* Clock dividers from HFCLK to the peripherals (boards/psoc4100s/part/peri_clk.h). The model has the 16-bit dividers. */
#include "emulator/psoc4/psoc4100s.h"

#define COMMAND 0x000u
#define SELECTS 0x100u
#define DIVIDERS_16 0x300u
#define COMMAND_ENABLE (1u << 31)
#define COMMAND_UNALIGNED (0xFFu << 8)
#define TYPE (3u << 6)
#define TYPE_16_BITS (1u << 6)
#define NUMBER 0x3Fu
#define DIVIDER_CYCLES 0xFFFF00u

/* Return the register at an offset that only stores its value, or NULL. */
static uint32_t *register_at(struct psoc_peri *peri, uint32_t offset)
{
    const uint32_t select = (offset - SELECTS) / 4u, divider = (offset - DIVIDERS_16) / 4u;
    if (offset & 3u) {
        return NULL;
    }
    if (offset >= DIVIDERS_16) {
        return divider < PSOC_PERI_DIVIDERS ? &peri->divider_16[divider] : NULL;
    }
    return offset >= SELECTS && select < PSOC_PERI_CLOCKS ? &peri->select[select] : NULL;
}

/* Read a register of the dividers. Returns false if the access is not modelled. */
bool psoc4100s_peri_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const uint32_t *target = register_at(&psoc->peri, offset);
    if (!target || access->size != 4u) {
        return false;
    }
    access->value = *target;
    return true;
}

/* Write a register of the dividers; a command starts a divider at once. Returns false if the access is not modelled. */
bool psoc4100s_peri_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    struct psoc_peri *peri = &psoc->peri;
    uint32_t *target = register_at(peri, offset);
    const uint32_t number = access->value & NUMBER;
    if (access->size != 4u) {
        return false;
    }
    if (offset == COMMAND) {
        if ((access->value & ~NUMBER) != (COMMAND_ENABLE | COMMAND_UNALIGNED | TYPE_16_BITS) ||
            number >= PSOC_PERI_DIVIDERS) {
            return false;
        }
        peri->is_running[number] = true;
        return true;
    }
    if (!target) {
        return false;
    }
    *target = access->value;
    return true;
}

/* Return the number of processor clock cycles per cycle of a peripheral's clock; 0 if the clock is off. */
uint32_t psoc4100s_clock_divider(const struct psoc *psoc, unsigned peripheral)
{
    const struct psoc_peri *peri = &psoc->peri;
    const uint32_t select = peripheral < PSOC_PERI_CLOCKS ? peri->select[peripheral] : 0u, number = select & NUMBER;
    if ((select & TYPE) != TYPE_16_BITS || number >= PSOC_PERI_DIVIDERS || !peri->is_running[number]) {
        return 0;
    }
    return ((peri->divider_16[number] & DIVIDER_CYCLES) >> 8) + 1u;
}
