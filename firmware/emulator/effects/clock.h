/* Errors of a board's oscillator in addition to clock_ppm of the world file; keys board=.
 *
 * Form `skew`: constant error of ppm. Form `wander`: thermal drift; the rate is multiplied by 1 + 1e-6 ppm sin(2 pi t /
 * period + phase) with period in seconds and a random phase per board. Conversions use the rate at the start of a scan;
 * the board's clock integrates the rate exactly. */
#ifndef EMULATOR_EFFECTS_CLOCK_H
#define EMULATOR_EFFECTS_CLOCK_H

#include <stdint.h>

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;

struct clock_effect {
    double skew_ppm[EFFECT_BOARDS_MAX], drift_ppm[EFFECT_BOARDS_MAX], period[EFFECT_BOARDS_MAX];
};

/* Clock drift of one board; amplitude 0: no drift. */
struct clock_drift {
    double amplitude, angular_frequency, phase;
};

int clock_read(struct effect_line *line, struct effects *effects);
/* Return the thermal drift of the oscillator of one board; its phase depends on the seed and the I2C address. */
struct clock_drift clock_drift_open(const struct clock_effect *clock, size_t board, uint64_t seed, uint8_t address);

/* Return the factor on the clock rate at a time (seconds). */
double clock_drift_factor(const struct clock_drift *drift, double time);
/* Return the seconds by which the drift has advanced the clock since time 0. */
double clock_drift_offset(const struct clock_drift *drift, double time);

#endif
