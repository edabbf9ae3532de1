/* Dividers of HFCLK for the peripherals, and the assignment of dividers to peripherals. Source: manufacturer's register
 * header of the block PERI, and configuration header of the PSoC 4100S for the numbers of the peripherals. Six 16-bit
 * dividers exist (confirm); three are used. */
#ifndef PART_PERI_CLK_H
#define PART_PERI_CLK_H

#include <stddef.h>
#include <stdint.h>

struct peri_clk_regs {
    volatile uint32_t command;
    uint32_t other[63];
    volatile uint32_t select[64];
    uint32_t divider_8[64];
    volatile uint32_t divider_16[64];
};

_Static_assert(offsetof(struct peri_clk_regs, select) == 0x100, "PERI_PCLK_CTL0 is at 0x40010100");
_Static_assert(offsetof(struct peri_clk_regs, divider_16) == 0x300, "PERI_DIV_16_CTL0 is at 0x40010300");

#define PERI_CLK ((struct peri_clk_regs *)0x40010000u)

/* Bits 8 to 23: input cycles per output cycle, minus 1. */
#define PERI_CLK_DIVIDER(cycles) (((cycles) - 1u) << 8)
#define PERI_CLK_16_BITS (1u << 6) /* type of divider in `select` and `command`; bits 0 to 5 are its number */
#define PERI_CLK_COMMAND_ENABLE (1u << 31)
#define PERI_CLK_COMMAND_UNALIGNED (0xFFu << 8) /* start the divider at once, not in phase with another divider */

#define PERI_CLK_OF_SCB0 0u
#define PERI_CLK_OF_SCB1 1u
#define PERI_CLK_OF_CSD 3u

enum peri_clk_divider {
    PERI_CLK_DIVIDER_OF_BUS = 0,
    PERI_CLK_DIVIDER_OF_UART = 1,
    PERI_CLK_DIVIDER_OF_CSD = 2,
};

/* Set a divider to `cycles`, start it, and connect the peripheral to it. */
static inline void peri_clk_start(enum peri_clk_divider divider, uint32_t peripheral, uint32_t cycles)
{
    PERI_CLK->divider_16[divider] = PERI_CLK_DIVIDER(cycles);
    PERI_CLK->select[peripheral] = PERI_CLK_16_BITS | (uint32_t)divider;
    PERI_CLK->command = PERI_CLK_COMMAND_ENABLE | PERI_CLK_COMMAND_UNALIGNED | PERI_CLK_16_BITS | (uint32_t)divider;
}

static inline void peri_clk_start_bus(uint32_t peripheral, uint32_t cycles)
{
    peri_clk_start(PERI_CLK_DIVIDER_OF_BUS, peripheral, cycles);
}

static inline void peri_clk_start_uart(uint32_t peripheral, uint32_t cycles)
{
    peri_clk_start(PERI_CLK_DIVIDER_OF_UART, peripheral, cycles);
}

#endif
