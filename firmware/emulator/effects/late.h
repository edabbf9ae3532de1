/* Delayed counts of a board; keys board=, seconds=.
 *
 * Form `delay`: buffering between converter and bus; the board measures the field of `seconds` ago (late_history.h).
 * Form `lag`: first-order low-pass filter with time constant `seconds` in front of the converter, one per electrode,
 * updated at each conversion of the electrode and exact for a count that changes linearly in between. */
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
