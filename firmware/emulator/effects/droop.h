/* Supply and reference voltages that fall under load. The drivers charge the added capacitance of every pressed taxel
 * at the TX clock: the load of a board is I = F_tx V sum(C_fringe rise) ampere over its taxels.
 *
 * Form `supply`: the hand's regulator with output resistance ohms feeds all boards. TX lines swing by V - ohms * (sum
 * of all loads), so every count of every board, including rest counts, is multiplied by 1 - ohms * sum / V. Form
 * `reference`: the reference of each board sets the converter's current. It falls by ohms * I / V of the board's own
 * load with time constant `seconds` (updated at each TX line, exact while the load changes linearly), and counts are
 * multiplied by 1 / (1 - fall), which has the opposite sign. With ohms 0 the sensor is ideal. A fall is limited to half
 * of the voltage. */
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

/* Loads of all boards at the records before and after the current time, as added capacitance in farad. */
struct droop_loads {
    double before[EFFECT_BOARDS_MAX], after[EFFECT_BOARDS_MAX];
    double all_before, all_after;
};

/* First-order low-pass filter. */
struct first_order {
    double time, input, output;
    bool has_started;
};

int droop_read(struct effect_line *line, struct effects *effects);
bool droop_is_on(const struct droop_effect *droop);

/* Return the factor on a hardware count of a board. fraction: position between the two records of `loads`, 0 to 1.
 * tx_hz: TX clock. time: seconds. */
double droop_factor(const struct droop_effect *droop, size_t board, const struct droop_loads *loads, double fraction,
                    double tx_hz, double time, struct first_order *reference);

/* Return the output of the filter with the time constant `seconds` at `time` (seconds), exact for an input that changes
 * linearly between calls. */
double first_order_step(struct first_order *filter, double time, double input, double seconds);

#endif
