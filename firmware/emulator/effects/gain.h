/* Sensitivity errors of taxels and boards.
 *
 * Form `electrode`: tolerance of electrodes and pillars. The fringe capacitance through the layer is multiplied by
 * factor * exp(log_std * n) with a standard normal n per taxel; rest count and signal change by different factors. Form
 * `idac`: error of the current source that balances the charge. The counts per farad are multiplied by factor *
 * exp(log_std * n) with n per board; rest count and signal change by the same factor. Lines for one board multiply with
 * lines for all boards. */
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

/* Apply the factors to the fringe capacitances and to the counts per farad, once, before the front end is configured.
 */
void gain_apply(const struct gain_effect *gain, size_t board, uint64_t seed, uint8_t address,
                struct front_end *front_end);

#endif
