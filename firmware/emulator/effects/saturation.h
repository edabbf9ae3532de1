/* The converter runs out of current: how far a count can move from rest. Keys counts= (the limit), strength= (1; mixes).
 *
 * Form `clip`: the current source cannot balance more charge; the hardware count stops at rest + counts.
 * Form `soft`: its output resistance loads it, as two resistors divide a voltage: x counts above rest read as
 * x counts / (x + counts): slope 1 at rest, half of the limit where x is the limit. */
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

/* A hardware count, of a taxel with that count at rest. */
double saturation_limit(const struct saturation_board *board, double rest, double hardware_count);

#endif
