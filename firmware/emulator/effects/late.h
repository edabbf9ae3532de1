/* A board whose counts are of an earlier skin; keys board=, seconds=.
 *
 * Form `delay`: buffers between converter and bus: what is measured is the field of `seconds` ago (late_history.h).
 * Form `lag`: a first-order low pass of time constant `seconds` in front of the converter, one for each electrode (what it
 * holds charge on), stepped at each of its conversions, exactly for a count that changes linearly between them. */
#ifndef EMULATOR_EFFECTS_LATE_H
#define EMULATOR_EFFECTS_LATE_H

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;

struct late_effect {
    double delay[EFFECT_BOARDS_MAX], lag[EFFECT_BOARDS_MAX]; /* seconds */
};

int late_read(struct effect_line *line, struct effects *effects);

#endif
