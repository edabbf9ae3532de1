/* A board's oscillator beyond the clock_ppm of its line; keys board=.
 *
 * Form `skew`: ppm, a constant error added. Form `wander`: temperature moves it: the rate is multiplied with
 * 1 + 1e-6 ppm sin(2 pi t / period + phase), the phase each board's own; period seconds. Conversions take the rate at the
 * start of a scan; the board's clock integrates it exactly. */
#ifndef EMULATOR_EFFECTS_CLOCK_H
#define EMULATOR_EFFECTS_CLOCK_H

#include <stdint.h>

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;

struct clock_effect {
    double skew_ppm[EFFECT_BOARDS_MAX], wander_ppm[EFFECT_BOARDS_MAX], period[EFFECT_BOARDS_MAX];
};

/* One board's wander; amplitude 0 if its oscillator stays. */
struct clock_wander {
    double amplitude, radian_a_second, phase;
};

int clock_read(struct effect_line *line, struct effects *effects);
struct clock_wander clock_wander_open(const struct clock_effect *clock, size_t board, uint64_t seed, uint8_t address);

/* The factor on the rate at a time, and the seconds by which that has put the clock ahead since time 0. */
double clock_wander_rate(const struct clock_wander *wander, double time);
double clock_wander_ahead(const struct clock_wander *wander, double time);

#endif
