/* System resources: main oscillator, watchdog, and reset cause (boards/psoc4100s/part/srss.h). */
#include "emulator/psoc4/psoc4100s.h"

#define CLK_SELECT 0x028u
#define WDT_MATCH 0x040u
#define INTR 0x044u
#define RES_CAUSE 0x054u
#define CLK_IMO_SELECT 0xF08u
#define CLK_IMO_TRIM1 0xF0Cu
#define CLK_IMO_TRIM3 0xF18u

#define HFCLK_QUARTER (2u << 2)
#define FREQUENCIES 7u
#define ILO_HZ 40000.0 /* nominal; a part's frequency is between 20 and 80 kHz (confirm) */
#define COUNTER_BITS 16u
#define MATCHES_TO_RESET 3u

/* Return the register of the system resources at an offset that only stores its value, or NULL. */
static uint32_t *register_at(struct psoc_srss *srss, uint32_t offset)
{
    switch (offset) {
    case CLK_SELECT:
        return &srss->select;
    case WDT_MATCH:
        return &srss->match;
    case RES_CAUSE:
        return &srss->cause;
    case CLK_IMO_SELECT:
        return &srss->imo_select;
    case CLK_IMO_TRIM1:
        return &srss->imo_trim1;
    case CLK_IMO_TRIM3:
        return &srss->imo_trim3;
    default:
        return NULL;
    }
}

/* Schedule the reset by the watchdog for the third match of its counter from a processor cycle on. The counter runs
 * from the reset on and is not cleared. Register WDT_MATCH contains the match value and the number of upper counter
 * bits that the comparison ignores; the counter therefore matches once per 2^(compared bits) cycles of the low-speed
 * oscillator. */
static void schedule_watchdog(struct psoc *psoc, uint64_t cycle)
{
    struct psoc_srss *srss = &psoc->srss;
    const uint64_t before = srss->reset_cycle;
    const unsigned ignored = srss->match >> 16 & 15u;
    const double period = (double)(1u << (COUNTER_BITS - ignored));
    const double match = (double)(srss->match & ((1u << (COUNTER_BITS - ignored)) - 1u));
    const double count = (double)(psoc_time(psoc, cycle) - srss->begin) / (double)VTIME_SECOND * ILO_HZ;
    const double passed = count < match ? 0.0 : (double)(uint64_t)((count - match) / period) + 1.0; /* matches so far */
    const double third = match + (passed + MATCHES_TO_RESET - 1u) * period;
    if (psoc->config.deviations.has_no_ilo) {
        srss->reset_cycle = PSOC_NEVER;
        return;
    }
    srss->reset_cycle = psoc_cycle(psoc, srss->begin + (vtime)(third / ILO_HZ * (double)VTIME_SECOND));
    if (srss->reset_cycle < before) {
        cortex_m0_stop(&psoc->cpu); /* the reset may occur within this run */
    }
}

/* Reset the system resources; the processor then runs with a quarter of the oscillator's 24 MHz, and the watchdog runs.
 * `causes`: bits of the register RES_CAUSE. */
void psoc4100s_srss_reset(struct psoc *psoc, uint32_t causes)
{
    psoc->srss =
        (struct psoc_srss){.select = HFCLK_QUARTER, .cause = causes, .begin = psoc->origin, .reset_cycle = PSOC_NEVER};
    schedule_watchdog(psoc, psoc->cpu.cycle);
}

/* Set the processor clock from the oscillator's frequency and its divider. Returns false for a setting that is not
 * modelled, and for a clock that is too fast for the wait states of the flash. */
static bool set_frequency(struct psoc *psoc, uint64_t cycle)
{
    const struct psoc_srss *srss = &psoc->srss;
    const uint32_t wait_states = psoc->cpuss.flash_ctl & 3u;
    if (srss->imo_select >= FREQUENCIES || (srss->select != 0u && srss->select != HFCLK_QUARTER)) {
        return false;
    }
    const double hz = (24e6 + 4e6 * srss->imo_select) / (srss->select ? 4.0 : 1.0);
    if (hz > (wait_states >= 2u ? 48e6 : wait_states ? 32e6 : 16e6)) {
        return false;
    }
    psoc_set_frequency(psoc, hz, cycle);
    schedule_watchdog(psoc, cycle);
    cortex_m0_stop(&psoc->cpu);
    return true;
}

/* Read a register of the system resources. Returns false if the emulator does not model the register. */
bool psoc4100s_srss_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const uint32_t *target = register_at(&psoc->srss, offset);
    if (!target || access->size != 4u) {
        return false;
    }
    access->value = *target;
    return true;
}

/* Write a register of the system resources. Returns false if the access is not modelled. */
bool psoc4100s_srss_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    uint32_t *target = register_at(&psoc->srss, offset);
    if (access->size != 4u || (!target && offset != INTR)) {
        return false;
    }
    switch (offset) {
    case INTR: /* clears the pending match */
        schedule_watchdog(psoc, access->cycle);
        return true;
    case RES_CAUSE:
        *target &= ~access->value;
        return true;
    case CLK_SELECT:
    case CLK_IMO_SELECT:
        *target = access->value;
        return set_frequency(psoc, access->cycle);
    case WDT_MATCH:
        *target = access->value;
        schedule_watchdog(psoc, access->cycle);
        return true;
    default:
        *target = access->value;
        return true;
    }
}
