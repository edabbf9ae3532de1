/* The CSX front end of one board: mutual capacitance in, raw count out, in the time that the scan settings ask for. */
#ifndef EMULATOR_FRONT_END_H
#define EMULATOR_FRONT_END_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/normals.h"
#include "emulator/vtime.h"
#include "generated/taxel_protocol.h"

struct front_end_taxel {
    double fixed_f;   /* capacitance that the layer does not touch, farad */
    double fringe_f;  /* capacitance through the layer at rest, farad */
    double rest_hardware_count; /* of the present settings, before quantisation */
};

/* How a conversion measures, as the block's registers have it: clocks of the processor, of the modulator (`sample`), of the sensor. */
struct front_end_setting {
    uint32_t period; /* modulator clocks */
    uint32_t sense;  /* modulator clocks of one TX clock */
    uint32_t sample; /* processor clocks of one modulator clock */
    uint8_t idac_code;
};

struct front_end {
    struct front_end_setting setting;
    struct front_end_taxel taxels[TAXEL_TAXELS_MAX];
    uint16_t taxel_count;
    double largest_count;
    double tx_hz;
    double idac_gain; /* 1, or what the board's current source does to every count */
    double counts_per_farad;
    vtime conversion_time;
    vtime settle_time;
    double noise_counts;
    struct normals *normals;
};

void front_end_init(struct front_end *front_end, uint16_t taxel_count, double noise_counts, struct normals *normals);
void front_end_configure(struct front_end *front_end, const struct taxel_scan_settings *settings, double clock_rate);
/* The same from registers. Returns whether anything has changed. */
bool front_end_set(struct front_end *front_end, const struct front_end_setting *setting, double clock_rate);
/* `rise`: relative rise of the layer's permittivity over the taxel. */
uint16_t front_end_convert(struct front_end *front_end, uint16_t taxel, double rise);

/* Its parts: the hardware count without noise, a draw of the white noise, and the raw count of a hardware count. */
double front_end_hardware_count(const struct front_end *front_end, uint16_t taxel, double rise);
double front_end_noise(struct front_end *front_end);
uint16_t front_end_quantise(const struct front_end *front_end, double hardware_count);

#endif
