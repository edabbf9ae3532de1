#include "emulator/front_end.h"

#include "emulator/costs.h"

#include <math.h>

#define TX_VOLT 3.3
#define IDAC_AMPERE_PER_CODE 1.2e-6 /* PSoC 4200 IDAC, 8-bit range (not verified on hardware) */
#define FIXED_CAPACITANCE_F 0.80e-12
#define FRINGE_CAPACITANCE_F 0.70e-12
#define CAPACITANCE_SPREAD 0.05 /* taxels differ at rest (thesis, section 2.5); relative standard deviation */

void front_end_init(struct front_end *front_end, uint16_t taxel_count, double noise_counts, struct normals *normals)
{
    front_end->taxel_count = taxel_count;
    front_end->noise_counts = noise_counts;
    front_end->normals = normals;
    front_end->idac_gain = 1.0;
    for (uint16_t i = 0; i < taxel_count; i++) {
        front_end->taxels[i].fixed_f = FIXED_CAPACITANCE_F * (1.0 + CAPACITANCE_SPREAD * normals_next(normals));
        front_end->taxels[i].fringe_f = FRINGE_CAPACITANCE_F;
    }
}

static bool is_same(const struct front_end_setting *a, const struct front_end_setting *b)
{
    return a->period == b->period && a->sense == b->sense && a->sample == b->sample && a->idac_code == b->idac_code;
}

/* The modulator balances the charge 2 C V of each TX period with the IDAC's current: hardware count = largest count
 * * 2 C V F_tx / I_dac, over sub_conversions TX periods of sense_clock_divider modulator clocks each. */
bool front_end_set(struct front_end *front_end, const struct front_end_setting *setting, double clock_rate)
{
    if (is_same(&front_end->setting, setting)) {
        return false;
    }
    const double modulator_hz = CPU_HZ / setting->sample;
    const double tx_hz = modulator_hz / setting->sense;
    const double idac_ampere = IDAC_AMPERE_PER_CODE * setting->idac_code;
    front_end->setting = *setting;
    front_end->largest_count = setting->period;
    front_end->tx_hz = tx_hz;
    front_end->counts_per_farad = front_end->largest_count * 2.0 * TX_VOLT * tx_hz / idac_ampere * front_end->idac_gain;
    front_end->conversion_time = (vtime)(front_end->largest_count / modulator_hz / clock_rate * (double)VTIME_SECOND);
    for (uint16_t i = 0; i < front_end->taxel_count; i++) {
        struct front_end_taxel *taxel = &front_end->taxels[i];
        taxel->rest_hardware_count = (taxel->fixed_f + taxel->fringe_f) * front_end->counts_per_farad;
    }
    return true;
}

void front_end_configure(struct front_end *front_end, const struct taxel_scan_settings *settings, double clock_rate)
{
    const struct front_end_setting setting = {
        .period = (uint32_t)settings->sub_conversions * settings->sense_clock_divider,
        .sense = settings->sense_clock_divider,
        .sample = settings->modulator_clock_divider,
        .idac_code = settings->idac_code,
    };
    front_end->setting.period = 0; /* what it was made from may have changed too: the gain of its current source */
    (void)front_end_set(front_end, &setting, clock_rate);
    front_end->settle_time = (vtime)(settings->settle_cycles / CPU_HZ / clock_rate * (double)VTIME_SECOND);
}

double front_end_hardware_count(const struct front_end *front_end, uint16_t taxel, double rise)
{
    const struct front_end_taxel *cell = &front_end->taxels[taxel];
    double hardware_count = cell->rest_hardware_count;
    if (rise != 0.0) {
        hardware_count += cell->fringe_f * rise * front_end->counts_per_farad;
    }
    return hardware_count;
}

double front_end_noise(struct front_end *front_end)
{
    return front_end->noise_counts > 0.0 ? front_end->noise_counts * normals_next(front_end->normals) : 0.0;
}

uint16_t front_end_quantise(const struct front_end *front_end, double hardware_count)
{
    /* raw = largest - hardware count: contact raises the capacitance and so lowers the raw count (thesis, Figure 2.5). */
    const double raw = front_end->largest_count - floor(hardware_count);
    return raw <= 0.0 ? 0 : raw >= front_end->largest_count ? (uint16_t)front_end->largest_count : (uint16_t)raw;
}

uint16_t front_end_convert(struct front_end *front_end, uint16_t taxel, double rise)
{
    const double hardware_count = front_end_hardware_count(front_end, taxel, rise);
    return front_end_quantise(front_end, hardware_count + front_end_noise(front_end));
}
