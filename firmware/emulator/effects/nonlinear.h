/* Converter whose counts are not proportional to the capacitance; keys board=.
 *
 * Form `dead_zone`: a first-order modulator with a leaky integrator locks to short patterns. With a leak per clock,
 * inputs near the fraction p/q of full scale all yield p/q; the plateau is leak (1 - leak (q - 1)) / q wide (contracted
 * rotation, for a small leak), up to q = 12. leak=0 is ideal; 0.004 gives 13 counts of 6400 at one half. Form `bow`:
 * voltage dependence of the modulator's capacitor. It adds counts * 4 u (1 - u) (1 + 0.5 (1 - 2 u)), where u is the
 * hardware count divided by the largest count: zero at both ends, `counts` in the middle, larger in the lower half. */
#ifndef EMULATOR_EFFECTS_NONLINEAR_H
#define EMULATOR_EFFECTS_NONLINEAR_H

#include <stdbool.h>

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;

struct nonlinear_effect {
    double leak[EFFECT_BOARDS_MAX], bow_counts[EFFECT_BOARDS_MAX];
};

int nonlinear_read(struct effect_line *line, struct effects *effects);
bool nonlinear_is_on(const struct nonlinear_effect *nonlinear, size_t board);
/* Return the hardware count that the converter outputs instead of `hardware_count`. largest_count: full scale. */
double nonlinear_count(const struct nonlinear_effect *nonlinear, size_t board, double largest_count,
                       double hardware_count);

#endif
