#include "emulator/effects/rheology.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define NEGLIGIBLE_M 1e-8 /* about a hundredth of a count */

/* Read a world-file line `effect rheology`: viscoelastic creep (`solid`) or hysteresis with logarithmic creep (`play`);
 * fractions of the compression, time constant in seconds, width of the hysteresis in metres. Returns 0, or -1 after an
 * error line on stderr. */
int rheology_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[RHEOLOGY_SOLID] = "solid", [RHEOLOGY_PLAY] = "play", NULL};
    struct rheology_effect *rheology = &effects->rheology;
    const int form = effect_line_form_index(line, forms);
    if (form < 0) {
        return -1;
    }
    *rheology = (struct rheology_effect){.form = (enum rheology_form)form};
    if (effect_line_number(line, "fraction", 0.0, 0.9, &rheology->fraction) ||
        effect_line_number(line, "seconds", 0.01, 1e4, &rheology->seconds)) {
        return -1;
    }
    return form == RHEOLOGY_PLAY && (effect_line_number(line, "width_m", 1e-6, 5e-4, &rheology->width_m) ||
                                     effect_line_optional(line, "creep", 0.0, 0.5, 0.0, &rheology->creep))
               ? -1
               : 0;
}

/* Return whether the world file requests the effect `rheology` (creep or hysteresis of the layer) with a nonzero
 * strength. */
bool rheology_is_on(const struct rheology_effect *rheology)
{
    return rheology->fraction != 0.0 || rheology->creep != 0.0;
}

/* Compute the exact coefficients of a first-order lag over a step: the share exp(-x) of an initial difference that
 * remains, and the lag (1 - exp(-x)) / x behind a linear ramp, with x = seconds / time_constant. */
static struct rheology_lag compute_lag(double seconds, double time_constant)
{
    const double x = seconds / time_constant;
    return (struct rheology_lag){.decay = exp(-x), .ramp = x > 0.0 ? -expm1(-x) / x : 1.0};
}

/* Return the output (metres) of a first-order lag after a step in which its input changed linearly from `from` to `to`.
 * slow: output before the step. A negligible output becomes 0, so that an unloaded cell ends its history. */
static inline double step_lag(const struct rheology_lag *lag, double slow, double from, double to)
{
    const double next = to - (to - from) * lag->ramp + (slow - from) * lag->decay;
    return next < NEGLIGIBLE_M ? 0.0 : next;
}

/* Compute the coefficients of the relaxations for a time step of `seconds`. Form `play` has three time constants one
 * decade apart, whose sum appears as creep that is logarithmic in time. is_step: the load changes at the end of the
 * time step, not linearly during the step. */
struct rheology_span rheology_span(const struct rheology_effect *rheology, double seconds, bool is_step)
{
    struct rheology_span span = {.is_step = is_step};
    for (int k = 0; k < RHEOLOGY_CREEPS; k++) {
        const double scale = rheology->form == RHEOLOGY_SOLID ? 1.0 : pow(10.0, k - 1);
        span.lags[k] = compute_lag(seconds, rheology->seconds * scale);
    }
    return span;
}

/* Advance a cell of form `solid` by one step, and return its compression (metres): a fraction of the elastic
 * compression `c` follows with a first-order lag. With is_step the compression changes at the end of the step. */
static double apply_solid(const struct rheology_effect *rheology, const struct rheology_span *span,
                          struct rheology_state *cell, double c)
{
    cell->slow[0] = step_lag(&span->lags[0], cell->slow[0], cell->input, span->is_step ? cell->input : c);
    cell->input = c;
    return c + rheology->fraction * (cell->slow[0] - c);
}

/* Advance a cell of form `play` by one step, and return its compression (metres). A fraction of the elastic compression
 * `c` passes through play operators (Prandtl and Ishlinskii). The output of an operator of width r is constant while it
 * lies in [c - r, c], where r is width_m * (i + 1) / RHEOLOGY_PLAYS for operator i; relaxations add creep. */
static double apply_play(const struct rheology_effect *rheology, const struct rheology_span *span,
                         struct rheology_state *cell, double c)
{
    double play_sum = 0.0, creep_sum = 0.0;
    for (int i = 0; i < RHEOLOGY_PLAYS; i++) {
        const double lower_bound = c - rheology->width_m * ((i + 1) / (double)RHEOLOGY_PLAYS);
        const double low = lower_bound > 0.0 ? lower_bound : 0.0;
        const double play = cell->play[i] < low ? low : cell->play[i] > c ? c : cell->play[i];
        cell->play[i] = play;
        play_sum += play;
    }
    const double x = c + rheology->fraction * (play_sum * (1.0 / RHEOLOGY_PLAYS) - c);
    for (int k = 0; rheology->creep > 0.0 && k < RHEOLOGY_CREEPS; k++) {
        cell->slow[k] = step_lag(&span->lags[k], cell->slow[k], cell->input, span->is_step ? cell->input : x);
        creep_sum += cell->slow[k];
    }
    cell->input = x;
    return x + rheology->creep * creep_sum * (1.0 / RHEOLOGY_CREEPS);
}

/* Return whether earlier loads still influence the compression of a cell. */
static bool has_memory(const struct rheology_state *cell)
{
    return cell->input > NEGLIGIBLE_M || cell->slow[0] != 0.0 || cell->slow[1] != 0.0 || cell->slow[2] != 0.0;
}

/* Replace the elastic compression (metres) of each cell by its history-dependent compression, and advance the history
 * by one step. Returns whether a cell still has history, so that the next step must not skip the cells. */
bool rheology_advance(const struct rheology_effect *rheology, const struct rheology_span *span,
                      struct rheology_state *cells, size_t count, double *compression)
{
    bool is_active = false;
    for (size_t i = 0; i < count; i++) {
        if (compression[i] > NEGLIGIBLE_M || has_memory(&cells[i])) {
            compression[i] = rheology->form == RHEOLOGY_SOLID ? apply_solid(rheology, span, &cells[i], compression[i])
                                                              : apply_play(rheology, span, &cells[i], compression[i]);
            is_active = is_active || has_memory(&cells[i]);
        }
    }
    return is_active;
}
