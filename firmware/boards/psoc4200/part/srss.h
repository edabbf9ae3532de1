/* System resources: oscillators, HFCLK and SYSCLK, watchdog counters, reset cause, trims. Source: Registers TRM
 * (001-85847), chapters CLK, WDT, RES and PWR; values as in the manufacturer's device header for this part. */
#ifndef PART_SRSS_H
#define PART_SRSS_H

#include <stddef.h>
#include <stdint.h>

struct clk_regs {
    volatile uint32_t select;
    volatile uint32_t ilo_config;
    volatile uint32_t imo_config;
};

_Static_assert(offsetof(struct clk_regs, ilo_config) == 0x04, "CLK_ILO_CONFIG is at 0x400B0104");
_Static_assert(offsetof(struct clk_regs, imo_config) == 0x08, "CLK_IMO_CONFIG is at 0x400B0108");

#define CLK ((struct clk_regs *)0x400B0100u)

#define CLK_SELECT_WDT_LOCK_MASK (3u << 14) /* written as 0: no change */
#define CLK_SELECT_HALF_EN (1u << 18)       /* flash accelerator at half of SYSCLK: needed above 24 MHz */
#define CLK_ENABLE (1u << 31)               /* of ILO_CONFIG and IMO_CONFIG */

struct wdt_regs {
    volatile uint32_t counter_low; /* counters 1 and 0 */
    volatile uint32_t counter_high;
    volatile uint32_t match; /* of counters 1 and 0 */
    volatile uint32_t config;
    volatile uint32_t control;
};

_Static_assert(offsetof(struct wdt_regs, match) == 0x08, "WDT_MATCH is at 0x400B0208");
_Static_assert(offsetof(struct wdt_regs, control) == 0x10, "WDT_CONTROL is at 0x400B0210");

#define WDT ((struct wdt_regs *)0x400B0200u)

#define WDT_CONFIG_MODE0_RESET (2u << 0) /* a match of counter 0 resets the processor */
#define WDT_CONFIG_MODE0_MASK (3u << 0)
#define WDT_CONTROL_ENABLE0 (1u << 0)
#define WDT_CONTROL_ENABLED0 (1u << 1) /* three LFCLK cycles after ENABLE0 */
#define WDT_CONTROL_RESET0 (1u << 3)   /* counter 0 begins at 0 */

#define RES_CAUSE (*(volatile uint32_t *)0x400B0300u) /* bits stay until 1 is written to them */

#define RES_CAUSE_WDT (1u << 0)
#define RES_CAUSE_DSBOD (1u << 1)
#define RES_CAUSE_LOCKUP (1u << 2)
#define RES_CAUSE_PROT_FAULT (1u << 3)
#define RES_CAUSE_SOFT (1u << 4)
#define RES_CAUSE_HVBOD (1u << 5)
#define RES_CAUSE_PBOD (1u << 6)
#define RES_CAUSE_XRES (1u << 7)
#define RES_CAUSE_ALL 0xFFu

/* Trims of the main oscillator: each frequency has an entry of its own in the supervisory flash (sflash.h). */
#define PWR_BG_TRIM4 (*(volatile uint32_t *)0x400BFF1Cu)  /* absolute, 6 bits */
#define PWR_BG_TRIM5 (*(volatile uint32_t *)0x400BFF20u)  /* temperature coefficient, 6 bits */
#define CLK_IMO_TRIM1 (*(volatile uint32_t *)0x400BFF28u) /* offset, 8 bits */
#define CLK_IMO_TRIM2 (*(volatile uint32_t *)0x400BFF2Cu) /* frequency code, 6 bits */

#define CLK_IMO_TRIM2_24MHZ 25u
#define CLK_IMO_TRIM2_48MHZ 53u

#endif
