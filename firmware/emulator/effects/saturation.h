/* Saturation of the converter: limit of the rise of a hardware count above its value without contact ("at rest"). Keys:
 * counts= (the limit), strength= (default 1; 0 is no effect, values between interpolate).
 *
 * Form `clip`: the current source cannot balance more charge, so the hardware count is limited to rest + counts. Form
 * `soft`: the output resistance of the current source forms a voltage divider: x counts above rest read as x counts /
 * (x + counts), with slope 1 at rest and half of the limit at x = counts. */
#ifndef EMULATOR_EFFECTS_SATURATION_H
#define EMULATOR_EFFECTS_SATURATION_H

#include <stdbool.h>

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;

struct saturation_board {
    bool soft;
    double counts, strength;
};

struct saturation_effect {
    struct saturation_board board[EFFECT_BOARDS_MAX];
};

int saturation_read(struct effect_line *line, struct effects *effects);

/* Return the hardware count after saturation. rest_count: hardware count of the taxel without contact. */
double saturation_limit(const struct saturation_board *board, double rest_count, double hardware_count);

#endif
