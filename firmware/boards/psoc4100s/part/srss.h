/* System resources: oscillators, HFCLK and SYSCLK, watchdog, reset cause, trims. Source: manufacturer's register header of
 * the block SRSSLT. */
#ifndef PART_SRSS_H
#define PART_SRSS_H

#include <stddef.h>
#include <stdint.h>

struct srss_regs {
    uint32_t power[10];
    volatile uint32_t clk_select;
    volatile uint32_t clk_ilo_config;
    volatile uint32_t clk_imo_config;
    uint32_t other;
    volatile uint32_t wdt_disable_key;
    volatile uint32_t wdt_counter;
    volatile uint32_t wdt_match;
    volatile uint32_t intr;
};

_Static_assert(offsetof(struct srss_regs, clk_select) == 0x28, "CLK_SELECT is at 0x40030028");
_Static_assert(offsetof(struct srss_regs, wdt_disable_key) == 0x38, "WDT_DISABLE_KEY is at 0x40030038");
_Static_assert(offsetof(struct srss_regs, wdt_match) == 0x40, "WDT_MATCH is at 0x40030040");
_Static_assert(offsetof(struct srss_regs, intr) == 0x44, "SRSS_INTR is at 0x40030044");

#define SRSS ((struct srss_regs *)0x40030000u)

/* HFCLK_SEL, HFCLK_DIV and SYSCLK_DIV 0: HFCLK and SYSCLK are the main oscillator. After a reset HFCLK_DIV is 2, a quarter
 * (confirm). */
#define SRSS_CLK_SELECT_WHOLE 0u

/* The counter of the watchdog runs with the 40 kHz oscillator from the reset on. It sets intr at each match; the third match
 * in a row without a write to intr resets the processor (confirm). */
#define SRSS_WDT_MATCH_IGNORED_BITS(count) \
    ((uint32_t)(count) << 16)         /* highest bits that take no part in the comparison */
#define SRSS_INTR_WDT_MATCH (1u << 0) /* writing 1 clears the bit */

#define RES_CAUSE (*(volatile uint32_t *)0x40030054u) /* bits stay until 1 is written to them (confirm) */

/* This part records no brown-out, lockup or external reset. */
#define RES_CAUSE_WDT (1u << 0)
#define RES_CAUSE_DSBOD 0u
#define RES_CAUSE_LOCKUP 0u
#define RES_CAUSE_PROT_FAULT (1u << 3)
#define RES_CAUSE_SOFT (1u << 4)
#define RES_CAUSE_HVBOD 0u
#define RES_CAUSE_PBOD 0u
#define RES_CAUSE_ALL (RES_CAUSE_WDT | RES_CAUSE_PROT_FAULT | RES_CAUSE_SOFT)

/* Main oscillator: frequency in steps of 4 MHz from 24 MHz on, and its trims. */
#define CLK_IMO_SELECT (*(volatile uint32_t *)0x40030F08u)
#define CLK_IMO_TRIM1 (*(volatile uint32_t *)0x40030F0Cu) /* offset, 8 bits */
#define CLK_IMO_TRIM3 (*(volatile uint32_t *)0x40030F18u) /* step size and temperature coefficient, 7 bits */

#define CLK_IMO_SELECT_48MHZ 6u

#endif
