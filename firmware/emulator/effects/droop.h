/* Supply and reference give way under load. The drivers charge every pressed taxel's added capacitance at the TX clock:
 * a board's load is I = F_tx V sum(C_fringe rise) ampere over its taxels.
 *
 * Form `supply`: the hand's regulator, of ohms, feeds all boards; TX lines swing by V - ohms * (sum of all loads), and so every
 * count of every board, rest too, scales by 1 - ohms * sum / V.
 * Form `reference`: a board's own reference sets the converter's current. It falls by ohms * I / V of the board's own load,
 * approached with `seconds` (in steps of a TX line, exact while the load changes linearly), and counts rise by 1 / (1 - fall): the other sign.
 * ohms 0 is the ideal sensor. A fall stops at half of the voltage. */
#ifndef EMULATOR_EFFECTS_DROOP_H
#define EMULATOR_EFFECTS_DROOP_H

#include <stdbool.h>

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;

struct droop_effect {
    double supply_ohms;
    double reference_ohms[EFFECT_BOARDS_MAX], reference_seconds[EFFECT_BOARDS_MAX];
};

/* The loads of all boards at the two records around now, as added capacitance, farad. */
struct droop_loads {
    double before[EFFECT_BOARDS_MAX], after[EFFECT_BOARDS_MAX];
    double all_before, all_after;
};

/* A value that follows its input with a first-order delay. */
struct first_order {
    double time, input, output;
    bool has_begun;
};

int droop_read(struct effect_line *line, struct effects *effects);
bool droop_is_on(const struct droop_effect *droop);

/* The factor on a hardware count, from the loads so far between their records and the TX clock. */
double droop_factor(const struct droop_effect *droop, size_t board, const struct droop_loads *loads, double fraction,
                    double tx_hz, double time, struct first_order *reference);

/* The output at a time, seconds, exact for an input that changes linearly from call to call. */
double first_order_step(struct first_order *filter, double time, double input, double seconds);

#endif
