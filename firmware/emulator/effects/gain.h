/* Taxels and boards that are more or less sensitive than they should be.
 *
 * Form `electrode`: electrodes and pillars differ. The fringe capacitance, which the layer touches, is multiplied with
 * factor * exp(log_std * n), n a standard normal number of each taxel: rest and drop change by different shares.
 * Form `idac`: the current source that the converter balances charges with is off: counts a farad are multiplied with
 * factor * exp(log_std * n), n of each board: rest and drop scale alike. Lines for one board multiply with those for all. */
#ifndef EMULATOR_EFFECTS_GAIN_H
#define EMULATOR_EFFECTS_GAIN_H

#include <stdint.h>

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;
struct front_end;

struct gain_board {
    double log_factor, log_std;
};

struct gain_effect {
    struct gain_board electrode[EFFECT_BOARDS_MAX], idac[EFFECT_BOARDS_MAX];
};

int gain_read(struct effect_line *line, struct effects *effects);

/* Changes the taxels' fringe capacitances and the board's counts a farad, once, before the front end is configured. */
void gain_apply(const struct gain_effect *gain, size_t board, uint64_t seed, uint8_t address, struct front_end *front_end);

#endif
