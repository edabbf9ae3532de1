/* Dividers of HFCLK for the peripherals, and the assignment of dividers to peripherals. Source: Registers TRM
 * (001-85847), CLK_DIVIDER_A00 .. CLK_SELECT15; values as in the manufacturer's device header for this part. Numbers
 * of the peripherals: SCB0 and TCPWM as in public projects for this part; SCB1 and CSD (confirm). */
#ifndef PART_PERI_CLK_H
#define PART_PERI_CLK_H

#include <stddef.h>
#include <stdint.h>

struct peri_clk_regs {
    volatile uint32_t divider_a[16]; /* elements 0, 1 and 2 exist; the same applies to B and C */
    volatile uint32_t divider_b[16];
    volatile uint32_t divider_c[16];
    uint32_t other[80];
    volatile uint32_t select[16];
};

_Static_assert(offsetof(struct peri_clk_regs, divider_b) == 0x40, "CLK_DIVIDER_B00 is at 0x40020040");
_Static_assert(offsetof(struct peri_clk_regs, divider_c) == 0x80, "CLK_DIVIDER_C00 is at 0x40020080");
_Static_assert(offsetof(struct peri_clk_regs, select) == 0x200, "CLK_SELECT00 is at 0x40020200");

#define PERI_CLK ((struct peri_clk_regs *)0x40020000u)

/* Low 16 bits: input cycles per output cycle, minus 1. */
#define PERI_CLK_DIVIDER_ENABLE (1u << 31)
#define PERI_CLK_DIVIDER_CASCADE \
    (1u << 30) /* of a divider B: its input is divider A of the same number instead of HFCLK */

#define PERI_CLK_SELECT_A(number) (0x10u | (number))
#define PERI_CLK_SELECT_B(number) (0x20u | (number))

/* Connect serial block `peripheral` to a divider by `cycles`: divider A0 for the I2C bus, B0 for the UART. */
static inline void peri_clk_start_bus(uint32_t peripheral, uint32_t cycles)
{
    PERI_CLK->divider_a[0] = (cycles - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->select[peripheral] = PERI_CLK_SELECT_A(0u);
}

static inline void peri_clk_start_uart(uint32_t peripheral, uint32_t cycles)
{
    PERI_CLK->divider_b[0] = (cycles - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->select[peripheral] = PERI_CLK_SELECT_B(0u);
}

#define PERI_CLK_OF_SCB0 2u
#define PERI_CLK_OF_SCB1 3u       /* (confirm) */
#define PERI_CLK_OF_CSD_SENSE 4u  /* csd_clk1 (confirm) */
#define PERI_CLK_OF_CSD_SAMPLE 5u /* csd_clk2 (confirm) */

#endif
