#include "emulator/effects/droop.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define FALL_MAX 0.5

/* Read a world-file line `effect droop`: output resistance (ohm) of the regulator that supplies all boards, or of the
 * voltage reference of a board, which follows its load with a time constant (seconds). Returns 0, or -1 after an error
 * line on stderr. */
int droop_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"supply", "reference", NULL};
    struct droop_effect *droop = &effects->droop;
    const int form = effect_line_form_index(line, forms);
    struct effect_boards boards;
    double ohms, seconds;
    if (form < 0 || effect_line_number(line, "ohms", 0.0, 1e6, &ohms)) {
        return -1;
    }
    if (form == 0) {
        droop->supply_ohms = ohms;
        return 0;
    }
    if (effect_line_boards(line, &boards) || effect_line_optional(line, "seconds", 1e-3, 1e4, 0.05, &seconds)) {
        return -1;
    }
    for (size_t i = boards.first; i < boards.end; i++) {
        droop->reference_ohms[i] = ohms;
        droop->reference_seconds[i] = seconds;
    }
    return 0;
}

/* Return whether the supply, or the reference of any board, has an output resistance. */
bool droop_is_on(const struct droop_effect *droop)
{
    for (size_t i = 0; i < EFFECT_BOARDS_MAX; i++) {
        if (droop->reference_ohms[i] > 0.0) {
            return true;
        }
    }
    return droop->supply_ohms > 0.0;
}

/* Limit the computed relative fall of a supply or reference voltage (1: fall to 0 V) to FALL_MAX. The linear model
 * of the droop is not valid for larger falls: a fall of 1 or more would be a voltage of 0 or below, and a division
 * by 0. */
static double limit_fall(double fall)
{
    return fmin(fall, FALL_MAX);
}

/* Return the factor by which voltage droop changes the hardware counts of a board. The drivers draw I = f C V, so a
 * voltage falls by the relative amount R f C. A lower supply lowers the TX swing and the count; a lower reference
 * lowers the balancing current and raises the count. `fraction` interpolates the load C (farad) between two stimulus
 * records. Advances the filter of the reference. */
double droop_factor(const struct droop_effect *droop, size_t board, const struct droop_loads *loads, double fraction,
                    double tx_hz, double time, struct first_order *reference)
{
    double factor = 1.0;
    if (droop->supply_ohms > 0.0) {
        const double farad = loads->all_before + fraction * (loads->all_after - loads->all_before);
        factor -= limit_fall(droop->supply_ohms * tx_hz * farad);
    }
    if (droop->reference_ohms[board] > 0.0) {
        const double farad = loads->before[board] + fraction * (loads->after[board] - loads->before[board]);
        const double load = droop->reference_ohms[board] * tx_hz * farad;
        factor /= 1.0 - limit_fall(first_order_step(reference, time, load, droop->reference_seconds[board]));
    }
    return factor;
}

/* Return the output of a first-order low-pass filter with time constant `seconds` at `time` (seconds); exact if the
 * input changes linearly between calls. The first call sets the output to the input. */
double first_order_step(struct first_order *filter, double time, double input, double seconds)
{
    if (!filter->has_started) {
        *filter = (struct first_order){.time = time, .input = input, .output = input, .has_started = true};
    }
    const double elapsed = time - filter->time;
    if (elapsed > 0.0) {
        const double slope = (input - filter->input) / elapsed;
        const double lag_error = filter->output - filter->input + slope * seconds;
        filter->output = input - slope * seconds + lag_error * exp(-elapsed / seconds);
        filter->time = time;
        filter->input = input;
    }
    return filter->output;
}
