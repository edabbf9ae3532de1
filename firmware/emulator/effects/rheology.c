#include "emulator/effects/rheology.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define FORGOTTEN_M 1e-8 /* some hundredth of a count */

int rheology_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[RHEOLOGY_SOLID] = "solid", [RHEOLOGY_PLAY] = "play", NULL};
    struct rheology_effect *rheology = &effects->rheology;
    const int form = effect_line_form(line, forms);
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

bool rheology_is_on(const struct rheology_effect *rheology)
{
    return rheology->fraction != 0.0 || rheology->creep != 0.0;
}

static struct rheology_lag lag_over(double seconds, double time_constant)
{
    const double x = seconds / time_constant;
    return (struct rheology_lag){.decay = exp(-x), .ramp = x > 0.0 ? -expm1(-x) / x : 1.0};
}

static inline double follow(const struct rheology_lag *lag, double slow, double from, double to)
{
    const double next = to - (to - from) * lag->ramp + (slow - from) * lag->decay;
    return next < FORGOTTEN_M ? 0.0 : next;
}

struct rheology_span rheology_span(const struct rheology_effect *rheology, double seconds, bool jump)
{
    struct rheology_span span = {.jump = jump};
    for (int k = 0; k < RHEOLOGY_CREEPS; k++) {
        const double scale = rheology->form == RHEOLOGY_SOLID ? 1.0 : pow(10.0, k - 1);
        span.lags[k] = lag_over(seconds, rheology->seconds * scale);
    }
    return span;
}

static double solid(const struct rheology_effect *rheology, const struct rheology_span *span, struct rheology_cell *cell,
                    double c)
{
    cell->slow[0] = follow(&span->lags[0], cell->slow[0], cell->input, span->jump ? cell->input : c);
    cell->input = c;
    return c + rheology->fraction * (cell->slow[0] - c);
}

static double stick(const struct rheology_effect *rheology, const struct rheology_span *span, struct rheology_cell *cell,
                    double c)
{
    double held = 0.0, crept = 0.0;
    for (int i = 0; i < RHEOLOGY_PLAYS; i++) {
        const double least = c - rheology->width_m * ((i + 1) / (double)RHEOLOGY_PLAYS);
        const double low = least > 0.0 ? least : 0.0;
        const double play = cell->play[i] < low ? low : cell->play[i] > c ? c : cell->play[i];
        cell->play[i] = play;
        held += play;
    }
    const double x = c + rheology->fraction * (held * (1.0 / RHEOLOGY_PLAYS) - c);
    for (int k = 0; rheology->creep > 0.0 && k < RHEOLOGY_CREEPS; k++) {
        cell->slow[k] = follow(&span->lags[k], cell->slow[k], cell->input, span->jump ? cell->input : x);
        crept += cell->slow[k];
    }
    cell->input = x;
    return x + rheology->creep * crept * (1.0 / RHEOLOGY_CREEPS);
}

static bool remembers(const struct rheology_cell *cell)
{
    return cell->input > FORGOTTEN_M || cell->slow[0] != 0.0 || cell->slow[1] != 0.0 || cell->slow[2] != 0.0;
}

bool rheology_advance(const struct rheology_effect *rheology, const struct rheology_span *span, struct rheology_cell *cells,
                      size_t count, double *compression)
{
    bool awake = false;
    for (size_t i = 0; i < count; i++) {
        if (compression[i] > FORGOTTEN_M || remembers(&cells[i])) {
            compression[i] = rheology->form == RHEOLOGY_SOLID ? solid(rheology, span, &cells[i], compression[i])
                                                              : stick(rheology, span, &cells[i], compression[i]);
            awake = awake || remembers(&cells[i]);
        }
    }
    return awake;
}
