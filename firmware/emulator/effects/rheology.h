/* The pillars' compression depends on what pressed them before, not on the pressure alone.
 *
 * Let c(t) be the compression that the layer's curve gives for the pressure (metres); out comes what the field sees.
 *
 * Form `solid`: a standard linear solid: a share of the pillars' compliance acts through a dashpot,
 *     out = c + fraction (q - c),   seconds dq/dt = c - q,
 * so that a press creeps up to c and a release leaves fraction q, which goes with the same time constant.
 *
 * Form `play`: pillars that stick: shortening lags behind, and what is short stays so until the pressure lets go of it. Play
 * operators (Prandtl and Ishlinskii) of RHEOLOGY_PLAYS half-widths r_i up to width_m, closed towards zero so that no load
 * leaves no lag: z_i is held unless that takes it out of [max(0, c - r_i), c];
 *     x = c + fraction (mean z_i - c).
 * On it comes creep over three decades about `seconds`, which looks logarithmic in time:
 *     out = x + creep mean q_k,   tau_k dq_k/dt = x - q_k,   tau = seconds / 10, seconds, 10 seconds.
 *
 * Between records c changes linearly, and each q is integrated in closed form, whatever the time. */
#ifndef EMULATOR_EFFECTS_RHEOLOGY_H
#define EMULATOR_EFFECTS_RHEOLOGY_H

#include <stdbool.h>
#include <stddef.h>

#define RHEOLOGY_PLAYS 4
#define RHEOLOGY_CREEPS 3

struct effect_line;
struct effects;

enum rheology_form {
    RHEOLOGY_SOLID,
    RHEOLOGY_PLAY,
};

struct rheology_effect {
    enum rheology_form form;
    double fraction, seconds;
    double width_m, creep; /* play */
};

/* What a cell remembers. All zero: nothing. */
struct rheology_cell {
    double input;                   /* what drove the relaxations at the last moment, metres */
    double play[RHEOLOGY_PLAYS];    /* metres */
    double slow[RHEOLOGY_CREEPS];   /* metres; a solid has one */
};

/* How a first-order lag answers, over one span of time, to its start and to a ramp. */
struct rheology_lag {
    double decay; /* what is left of a difference */
    double ramp;  /* how far, in parts of the ramp's rise, it ends behind the ramp */
};

struct rheology_span {
    struct rheology_lag lags[RHEOLOGY_CREEPS];
    bool jump;
};

int rheology_read(struct effect_line *line, struct effects *effects);
bool rheology_is_on(const struct rheology_effect *rheology);

/* Over `seconds`; `jump`: the compression changed all at once at their end, not linearly. */
struct rheology_span rheology_span(const struct rheology_effect *rheology, double seconds, bool jump);

/* That time has passed. compression [count]: metres by the layer's curve now, replaced by what the field sees. Returns whether
 * one of these cells remembers anything. */
bool rheology_advance(const struct rheology_effect *rheology, const struct rheology_span *span, struct rheology_cell *cells,
                      size_t count, double *compression);

#endif
