/* CapSense block. A conversion takes a number of sample clocks and counts those in which the current source was on. The
 * board's front end computes the count, as for a native board. */
#include "emulator/psoc4/psoc4200.h"

#define CSD_ID 0x00u
#define CSD_CONFIG 0x04u
#define CSD_IDAC 0x08u
#define CSD_COUNTER 0x0Cu
#define CSD_STATUS 0x10u
#define CSD_INTR 0x14u
#define CSD_TRIM1 0xFF00u

#define CONFIG_ENABLE (1u << 31)
#define CONFIG_SENSE_EN (1u << 12)
#define CONFIG_TWO_CAPACITORS (1u << 4)
#define CONFIG_OF_TWO_CAPACITORS (1u << 3 | 1u << 4 | 1u << 13) /* filter, two capacitors, reference buffer */
#define STATUS_SENSE (1u << 1)
#define STATUS_SAMPLE (1u << 3)
#define SENSE_HALVES 2u
#define CLOCK_SENSE 4u /* numbers of the peripheral clocks */
#define CLOCK_SAMPLE 5u
#define AMUX_A 6u       /* function of a pin that is on analog bus A */
#define STARTS_AFTER 1u /* sample clocks between the write of the period and the first count */

/* Set the interrupt line of the capacitance converter to the state of its interrupt cause. */
static void update_interrupt(struct psoc *psoc)
{
    psoc_set_line(psoc, psoc_actual(psoc->config.deviations.irq_csd, psoc_family(psoc)->irq_csd), psoc->csd.intr & 1u);
}

/* Start a conversion of `period` sample clocks at a processor cycle. Returns false (access not modelled) if the block
 * is off or its clocks are not set up; a part that tolerates missing clocks ignores the start instead. */
static bool start_conversion(struct psoc *psoc, uint32_t period, uint64_t cycle)
{
    struct psoc_csd *csd = &psoc->csd;
    const struct psoc_deviations *deviations = &psoc->config.deviations;
    csd->sample = psoc4200_clock_divider(psoc, psoc_actual(deviations->clock_csd_sample, CLOCK_SAMPLE));
    csd->sense = psoc4200_clock_divider(psoc, psoc_actual(deviations->clock_csd_sense, CLOCK_SENSE)) * SENSE_HALVES;
    if (!(csd->config & CONFIG_ENABLE) || !period) {
        return false;
    }
    if (!csd->sample || (!csd->sense && !deviations->tolerates_no_clock)) {
        return deviations->tolerates_no_clock;
    }
    csd->sense /= csd->sample; /* from processor cycles to sample clocks */
    csd->period = period;
    csd->begin = cycle + (uint64_t)STARTS_AFTER * csd->sample;
    csd->end = csd->begin + (uint64_t)period * csd->sample;
    csd->counter = period << 16;
    cortex_m0_stop(&psoc->cpu); /* the conversion may end within this run */
    return true;
}

/* Return whether the settings of the converter let the current source balance the charge; otherwise a conversion gives
 * the count 0.
 * With two capacitors the model requires the bits that the manufacturer's driver sets; with one capacitor, the bit of
 * two capacitors prevents the measurement. */
static bool balances_charge(const struct psoc *psoc)
{
    const bool has_two = psoc->config.part->has_two_capacitors;
    const uint32_t bits = has_two ? CONFIG_OF_TWO_CAPACITORS : CONFIG_TWO_CAPACITORS;
    const uint32_t config = psoc->csd.config;
    return config & CONFIG_SENSE_EN && psoc->csd.sense && (config & bits) == (has_two ? bits : 0u) &&
           psoc_has_capacitors(psoc, AMUX_A);
}

/* End the conversion: compute the count from the connected TX and RX lines, the clocks and the current code, and raise
 * the interrupt. */
void psoc4200_csd_end(struct psoc *psoc)
{
    struct psoc_csd *csd = &psoc->csd;
    struct psoc_conversion conversion = {
        .period = csd->period,
        .sense = csd->sense,
        .sample = csd->sample,
        .idac_code = (uint8_t)csd->idac,
    };
    if (psoc_finish_conversion(psoc, &conversion, balances_charge(psoc), &csd->counter)) {
        csd->intr |= 1u;
        update_interrupt(psoc);
    }
}

/* Return the value of the converter's register COUNTER at a processor cycle. During a conversion the low half is the
 * count so far; the model returns 0 there, which is exact before the first sense clock. The firmware reads the register
 * only until then. */
static uint32_t counter_at(const struct psoc_csd *csd, uint64_t cycle)
{
    if (csd->end == PSOC_NEVER || cycle < csd->begin) {
        return csd->counter;
    }
    return (csd->period - (uint32_t)((cycle - csd->begin) / csd->sample)) << 16;
}

/* Read a register of the capacitive sensing block (CSD). Returns false if the emulator does not model the register. */
bool psoc4200_csd_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    const struct psoc_csd *csd = &psoc->csd;
    switch (access->size == 4u ? offset : UINT32_MAX) {
    case CSD_CONFIG:
        access->value = csd->config;
        return true;
    case CSD_IDAC:
        access->value = csd->idac;
        return true;
    case CSD_COUNTER:
        access->value = counter_at(csd, access->cycle);
        return true;
    case CSD_STATUS:
        access->value = csd->config & CONFIG_SENSE_EN ? STATUS_SENSE | STATUS_SAMPLE : 0u;
        return true;
    case CSD_INTR:
        access->value = csd->intr;
        return true;
    case CSD_TRIM1:
        access->value = csd->trim1;
        return true;
    default:
        return false;
    }
}

/* Write a register of the capacitive sensing block (CSD); a write to COUNTER starts a conversion. Returns false if the
 * access is not modelled. */
bool psoc4200_csd_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    struct psoc_csd *csd = &psoc->csd;
    switch (access->size == 4u ? offset : UINT32_MAX) {
    case CSD_CONFIG:
        csd->config = access->value;
        return true;
    case CSD_IDAC:
        csd->idac = access->value;
        return true;
    case CSD_COUNTER:
        return start_conversion(psoc, access->value >> 16, access->cycle);
    case CSD_INTR:
        csd->intr &= ~access->value;
        update_interrupt(psoc);
        return true;
    case CSD_TRIM1:
        csd->trim1 = access->value;
        return true;
    default:
        return false;
    }
}
