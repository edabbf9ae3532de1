#include "emulator/physics/front_end.h"

#include "emulator/base/costs.h"

#include <math.h>

#define TX_VOLT 3.3
#define IDAC_AMPERE_PER_CODE 1.2e-6 /* PSoC 4200 IDAC, 8-bit range (not verified on hardware) */
#define FIXED_CAPACITANCE_F 0.80e-12
#define FRINGE_CAPACITANCE_F 0.70e-12
#define CAPACITANCE_STD 0.05 /* relative standard deviation of the fixed capacitance (thesis, section 2.5) */

/* Set the capacitances of the taxels: a fixed part with a random tolerance (standard deviation 5 %), which contact does
 * not change, and the fringe capacitance through the layer. `noise_counts`: standard deviation of the white noise. */
void front_end_init(struct front_end *front_end, uint16_t taxel_count, double noise_counts,
                    struct normal_source *normals)
{
    front_end->taxel_count = taxel_count;
    front_end->noise_counts = noise_counts;
    front_end->normals = normals;
    front_end->idac_gain = 1.0;
    for (uint16_t i = 0; i < taxel_count; i++) {
        front_end->taxels[i].fixed_f = FIXED_CAPACITANCE_F * (1.0 + CAPACITANCE_STD * normal_source_sample(normals));
        front_end->taxels[i].fringe_f = FRINGE_CAPACITANCE_F;
    }
}

/* Return whether two settings give the same conversion from capacitance to raw count. */
static bool are_settings_equal(const struct front_end_settings *a, const struct front_end_settings *b)
{
    return a->conversion_clocks == b->conversion_clocks && a->sense_clocks == b->sense_clocks &&
           a->modulator_divider == b->modulator_divider && a->idac_code == b->idac_code;
}

/* Compute timing and counts per farad from the registers of the converter. The modulator balances the charge 2 C V of
 * each TX period with the current of the IDAC: hardware count = max_count * 2 C V F_tx / I_dac. Returns false if no
 * register has changed; `clock_rate`: CPU clock relative to its nominal frequency. */
bool front_end_apply_settings(struct front_end *front_end, const struct front_end_settings *settings, double clock_rate)
{
    if (are_settings_equal(&front_end->settings, settings)) {
        return false;
    }
    const double modulator_hz = CPU_HZ / settings->modulator_divider;
    const double tx_hz = modulator_hz / settings->sense_clocks;
    const double idac_ampere = IDAC_AMPERE_PER_CODE * settings->idac_code;
    front_end->settings = *settings;
    front_end->max_count = settings->conversion_clocks;
    front_end->tx_hz = tx_hz;
    front_end->counts_per_farad = front_end->max_count * 2.0 * TX_VOLT * tx_hz / idac_ampere * front_end->idac_gain;
    front_end->conversion_time = (vtime)(front_end->max_count / modulator_hz / clock_rate * (double)VTIME_SECOND);
    for (uint16_t i = 0; i < front_end->taxel_count; i++) {
        struct front_end_taxel *taxel = &front_end->taxels[i];
        taxel->rest_hardware_count = (taxel->fixed_f + taxel->fringe_f) * front_end->counts_per_farad;
    }
    return true;
}

/* Apply the scan settings of the protocol: conversion time and counts per farad follow from them. `clock_rate`: CPU
 * clock relative to its nominal frequency. */
void front_end_configure(struct front_end *front_end, const struct taxel_scan_settings *scan, double clock_rate)
{
    const struct front_end_settings settings = {
        .conversion_clocks = (uint32_t)scan->sub_conversions * scan->sense_clock_divider,
        .sense_clocks = scan->sense_clock_divider,
        .modulator_divider = scan->modulator_clock_divider,
        .idac_code = scan->idac_code,
    };
    front_end->settings.conversion_clocks = 0; /* forces the update: idac_gain may have changed since the last one */
    (void)front_end_apply_settings(front_end, &settings, clock_rate);
    front_end->settle_time = (vtime)(scan->settle_cycles / CPU_HZ / clock_rate * (double)VTIME_SECOND);
}

/* Return the hardware count of a taxel before noise and quantisation. rise: relative rise of the layer's permittivity,
 * by which the fringe capacitance increases. */
double front_end_hardware_count(const struct front_end *front_end, uint16_t taxel, double rise)
{
    const struct front_end_taxel *electrode = &front_end->taxels[taxel];
    double hardware_count = electrode->rest_hardware_count;
    if (rise != 0.0) {
        hardware_count += electrode->fringe_f * rise * front_end->counts_per_farad;
    }
    return hardware_count;
}

/* Return a random value of the read-out noise in counts; 0 if the noise is off. */
double front_end_sample_noise(struct front_end *front_end)
{
    return front_end->noise_counts > 0.0 ? front_end->noise_counts * normal_source_sample(front_end->normals) : 0.0;
}

/* Return the raw count of a hardware count: full scale minus the integer part, limited to the range of the
 * converter. */
uint16_t front_end_quantise(const struct front_end *front_end, double hardware_count)
{
    /* Contact raises the capacitance and so lowers the raw count (thesis, Figure 2.5). */
    const double raw = front_end->max_count - floor(hardware_count);
    return raw <= 0.0 ? 0 : raw >= front_end->max_count ? (uint16_t)front_end->max_count : (uint16_t)raw;
}

/* Return the raw count of a taxel, with noise. rise: relative rise of the permittivity of the layer above the taxel. */
uint16_t front_end_convert(struct front_end *front_end, uint16_t taxel, double rise)
{
    const double hardware_count = front_end_hardware_count(front_end, taxel, rise);
    return front_end_quantise(front_end, hardware_count + front_end_sample_noise(front_end));
}
