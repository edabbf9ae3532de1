/* Clock dividers from HFCLK to the peripherals (boards/psoc4200/part/peri_clk.h). */
#include "emulator/psoc4/psoc4200.h"

#define DIVIDERS 3u
#define ENABLE (1u << 31)
#define CASCADE (1u << 30)
#define SELECTS 0x200u

/* Return the register of the peripheral clock dividers at an offset, or NULL: dividers A (0x000), B (0x040) and C
 * (0x080), and the divider that each peripheral selects (0x200). */
static uint32_t *register_at(struct psoc_clocks *clocks, uint32_t offset)
{
    const uint32_t index = offset >> 2 & 15u;
    if (offset & 3u) {
        return NULL;
    }
    switch (offset & ~0x3Fu) {
    case 0x000u:
        return index < DIVIDERS ? &clocks->divider_a[index] : NULL;
    case 0x040u:
        return index < DIVIDERS ? &clocks->divider_b[index] : NULL;
    case 0x080u:
        return index < DIVIDERS ? &clocks->divider_c[index] : NULL;
    case SELECTS:
        return &clocks->select[index];
    default:
        return NULL;
    }
}

/* Read a register of the peripheral clock dividers. Returns false if the access is not modelled. */
bool psoc4200_clocks_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const uint32_t *target = register_at(&psoc->clocks, offset);
    if (!target || access->size != 4u) {
        return false;
    }
    access->value = *target;
    return true;
}

/* Write a register of the peripheral clock dividers. Returns false if the access is not modelled. */
bool psoc4200_clocks_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    uint32_t *target = register_at(&psoc->clocks, offset);
    if (!target || access->size != 4u) {
        return false;
    }
    *target = access->value;
    return true;
}

/* Return the number of input cycles per output cycle of a clock divider with this register value; 0 if the divider is
 * disabled. */
static uint32_t divider_cycles(uint32_t divider)
{
    return divider & ENABLE ? (divider & 0xFFFFu) + 1u : 0u;
}

/* Return the number of processor clock cycles per cycle of a peripheral's clock; 0 if the clock is off. A cascaded
 * divider B multiplies divider A. */
uint32_t psoc4200_clock_divider(const struct psoc *psoc, unsigned peripheral)
{
    const struct psoc_clocks *clocks = &psoc->clocks;
    const uint32_t select = clocks->select[peripheral];
    const uint32_t number = select & 15u;
    if (number >= DIVIDERS) {
        return 0;
    }
    switch (select >> 4 & 3u) {
    case 1:
        return divider_cycles(clocks->divider_a[number]);
    case 2: {
        const uint32_t b = clocks->divider_b[number];
        return b & CASCADE ? divider_cycles(b) * divider_cycles(clocks->divider_a[number]) : divider_cycles(b);
    }
    case 3: {
        const uint32_t c = clocks->divider_c[number];
        return c & CASCADE ? 0u : divider_cycles(c); /* cascading from divider B is not used by the firmware */
    }
    default:
        return 0;
    }
}
