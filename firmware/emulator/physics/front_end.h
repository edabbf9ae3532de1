/* The ideal CSX front end of one board: converts the mutual capacitance of a taxel to a raw count, in the time that the
 * scan settings require.
 *
 * hardware count = max_count * 2 C V F_tx / I_dac; raw count = max_count - hardware count, quantised. Contact raises
 * the capacitance and therefore lowers the raw count. */
#ifndef EMULATOR_PHYSICS_FRONT_END_H
#define EMULATOR_PHYSICS_FRONT_END_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/base/normal_source.h"
#include "emulator/base/vtime.h"
#include "generated/taxel_protocol.h"

struct front_end_taxel {
    double fixed_f;             /* capacitance that contact does not change, farad */
    double fringe_f;            /* capacitance through the layer without contact, farad */
    double rest_hardware_count; /* without contact, under the present settings, before quantisation */
};

/* The timing of a conversion, as the registers of the CSD block contain it. */
struct front_end_settings {
    uint32_t conversion_clocks; /* modulator clocks of a conversion */
    uint32_t sense_clocks;      /* modulator clocks of one TX period */
    uint32_t modulator_divider; /* CPU clocks of one modulator clock */
    uint8_t idac_code;
};

struct front_end {
    struct front_end_settings settings;
    struct front_end_taxel taxels[TAXEL_TAXELS_MAX];
    uint16_t taxel_count;
    double max_count; /* full scale */
    double tx_hz;
    double idac_gain; /* relative gain of the board's current source; 1 is ideal */
    double counts_per_farad;
    vtime conversion_time;
    vtime settle_time;
    double noise_counts; /* standard deviation of the white noise */
    struct normal_source *normals;
};

void front_end_init(struct front_end *front_end, uint16_t taxel_count, double noise_counts,
                    struct normal_source *normals);

/* Apply scan settings of the protocol to the front end. clock_rate: CPU clock relative to its nominal frequency. */
void front_end_configure(struct front_end *front_end, const struct taxel_scan_settings *scan, double clock_rate);

/* Apply register values. Returns whether any of them has changed. */
bool front_end_apply_settings(struct front_end *front_end, const struct front_end_settings *settings,
                              double clock_rate);

/* Return the raw count of a taxel, with noise. rise: relative rise of the permittivity of the layer above the taxel. */
uint16_t front_end_convert(struct front_end *front_end, uint16_t taxel, double rise);

/* Execute one of the three steps of front_end_convert(). They return the hardware count without noise, a sample of the
 * white noise, and the raw count of a hardware count. */
double front_end_hardware_count(const struct front_end *front_end, uint16_t taxel, double rise);
double front_end_sample_noise(struct front_end *front_end);
uint16_t front_end_quantise(const struct front_end *front_end, double hardware_count);

#endif
