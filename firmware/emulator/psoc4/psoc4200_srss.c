/* System resources: frequency of the main oscillator, counter 0 of the watchdog, cause of the last reset. */
#include <string.h>

#include "emulator/psoc4/psoc4200.h"

#define CLK_SELECT 0x100u
#define CLK_ILO_CONFIG 0x104u
#define CLK_IMO_CONFIG 0x108u
#define WDT_COUNTER_LOW 0x200u
#define WDT_MATCH 0x208u
#define WDT_CONFIG 0x20Cu
#define WDT_CONTROL 0x210u
#define RES_CAUSE 0x300u
#define PWR_BG_TRIM4 0xFF1Cu
#define PWR_BG_TRIM5 0xFF20u
#define CLK_IMO_TRIM1 0xFF28u
#define CLK_IMO_TRIM2 0xFF2Cu

#define SELECT_HALF_EN (1u << 18)
#define SELECT_MODELLED (SELECT_HALF_EN | 3u << 14)
#define OSCILLATOR_ENABLE (1u << 31)
#define TRIM2_24MHZ 25u
#define TRIM2_48MHZ 53u
#define ILO_HZ 32768.0 /* nominal; a part's frequency is between 15 and 60 kHz */
#define CONFIG_RESETS 2u
#define CONFIG_MODE 3u
#define CONTROL_ENABLE (1u << 0)
#define CONTROL_ENABLED (1u << 1)
#define CONTROL_RESET (1u << 3)

/* Return the register of the system resources (clocks, watchdog, reset cause, trims) at an offset, or NULL. */
static uint32_t *register_at(struct psoc_srss *srss, uint32_t offset)
{
    switch (offset) {
    case CLK_SELECT:
        return &srss->select;
    case CLK_ILO_CONFIG:
        return &srss->ilo_config;
    case CLK_IMO_CONFIG:
        return &srss->imo_config;
    case WDT_MATCH:
        return &srss->match;
    case WDT_CONFIG:
        return &srss->wdt_config;
    case WDT_CONTROL:
        return &srss->wdt_control;
    case RES_CAUSE:
        return &srss->cause;
    case PWR_BG_TRIM4:
        return &srss->bg_trim4;
    case PWR_BG_TRIM5:
        return &srss->bg_trim5;
    case CLK_IMO_TRIM1:
        return &srss->imo_trim1;
    case CLK_IMO_TRIM2:
        return &srss->imo_trim2;
    default:
        return NULL;
    }
}

/* Reset the system resources; the oscillator then runs at 24 MHz. `causes`: bits of the register RES_CAUSE. */
void psoc4200_srss_reset(struct psoc *psoc, uint32_t causes)
{
    psoc->srss = (struct psoc_srss){
        .imo_config = OSCILLATOR_ENABLE,
        .ilo_config = OSCILLATOR_ENABLE,
        .imo_trim2 = TRIM2_24MHZ,
        .cause = causes,
        .reset_cycle = PSOC_NEVER,
    };
}

/* Schedule the watchdog reset for the time at which the counter reaches the match value; cancel it if the watchdog is
 * not configured to reset. */
static void schedule_watchdog(struct psoc *psoc, uint64_t cycle)
{
    struct psoc_srss *srss = &psoc->srss;
    const double cycles_a_second = (double)VTIME_SECOND / psoc->ps_per_cycle;
    const bool can_reset = !psoc->config.deviations.has_no_ilo && srss->wdt_control & CONTROL_ENABLE &&
                           (srss->wdt_config & CONFIG_MODE) == CONFIG_RESETS;
    const uint64_t before = srss->reset_cycle;
    srss->reset_cycle = can_reset ? cycle + (uint64_t)((srss->match & 0xFFFFu) / ILO_HZ * cycles_a_second) : PSOC_NEVER;
    if (srss->reset_cycle < before) {
        cortex_m0_stop(&psoc->cpu); /* the reset may occur within this run */
    }
}

/* Set the main oscillator to 24 or 48 MHz from its frequency code. Returns false for other codes, and for 48 MHz
 * without flash wait states. */
static bool set_frequency(struct psoc *psoc, uint32_t code, uint64_t cycle)
{
    if (code != TRIM2_24MHZ && code != TRIM2_48MHZ) {
        return false;
    }
    if (code == TRIM2_48MHZ && !(psoc->srss.select & SELECT_HALF_EN)) {
        return false; /* 48 MHz would exceed the flash's speed without wait states */
    }
    psoc_set_frequency(psoc, code == TRIM2_48MHZ ? 48e6 : 24e6, cycle);
    cortex_m0_stop(&psoc->cpu);
    return true;
}

/* Read a register of the system resources. Returns false if the emulator does not model the register. */
bool psoc4200_srss_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const uint32_t *target = register_at(&psoc->srss, offset);
    if (!target || access->size != 4u) {
        return false;
    }
    access->value = *target;
    if (offset == WDT_CONTROL) {
        access->value |= *target & CONTROL_ENABLE ? CONTROL_ENABLED : 0u;
    }
    return true;
}

/* Write a register of the system resources: flash wait states, oscillator frequency, watchdog, or reset causes (cleared
 * by 1 bits). Returns false if the access is not modelled. */
bool psoc4200_srss_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    struct psoc_srss *srss = &psoc->srss;
    uint32_t *target = register_at(srss, offset);
    if (!target || access->size != 4u) {
        return false;
    }
    switch (offset) {
    case CLK_SELECT:
        if (access->value & ~SELECT_MODELLED) {
            return false;
        }
        *target = access->value;
        cortex_m0_set_flash_wait(&psoc->cpu, access->value & SELECT_HALF_EN ? 1u : 0u);
        return true;
    case RES_CAUSE:
        *target &= ~access->value;
        return true;
    case CLK_IMO_TRIM2:
        *target = access->value;
        return set_frequency(psoc, access->value, access->cycle);
    case WDT_CONTROL:
        *target = access->value & ~CONTROL_RESET;
        if (access->value & CONTROL_RESET || srss->reset_cycle == PSOC_NEVER) {
            schedule_watchdog(psoc, access->cycle);
        }
        return true;
    default:
        *target = access->value;
        return true;
    }
}
