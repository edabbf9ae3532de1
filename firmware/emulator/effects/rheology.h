/* Compression of the pillars that depends on the load history.
 *
 * c(t) is the compression from the layer's curve for the pressure (metres); out is the compression that determines the
 * field.
 *
 * Form `solid`: standard linear solid. A fraction of the compliance acts through a dashpot,
 *         out = c + fraction (q - c),   seconds dq/dt = c - q,
 * so that a contact creeps up to c, and a release leaves fraction q, which decays with the same time constant.
 *
 * Form `play`: sticking pillars. Shortening lags behind, and pillars stay short until the pressure releases them: play
 * operators (Prandtl and Ishlinskii) with RHEOLOGY_PLAYS half-widths r_i up to width_m, limited at zero so that an
 * unloaded cell has no lag. z_i is constant unless it leaves [max(0, c - r_i), c];
 *         x = c + fraction (mean z_i - c).
 * Creep over three decades around `seconds`, which appears logarithmic in time, is added:
 *         out = x + creep mean q_k,   tau_k dq_k/dt = x - q_k,   tau = seconds / 10, seconds, 10 seconds.
 *
 * Between records c changes linearly, and each q is integrated in closed form for any step length. */
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

/* State of a cell; all zero without history. */
struct rheology_state {
    double input;                 /* input of the relaxations at the last call, metres */
    double play[RHEOLOGY_PLAYS];  /* metres */
    double slow[RHEOLOGY_CREEPS]; /* metres; a solid uses one */
};

/* Response of a first-order lag over one time step to its initial state and to a ramp. */
struct rheology_lag {
    double decay; /* remaining share of an initial difference */
    double ramp;  /* lag behind the ramp at its end, relative to the rise of the ramp */
};

/* Coefficients of one time step for all cells. */
struct rheology_span {
    struct rheology_lag lags[RHEOLOGY_CREEPS];
    bool is_step;
};

int rheology_read(struct effect_line *line, struct effects *effects);
bool rheology_is_on(const struct rheology_effect *rheology);

/* Compute the coefficients of a step of `seconds`. is_step: the compression is constant during the step and changes at
 * its end; otherwise it changes linearly. */
struct rheology_span rheology_span(const struct rheology_effect *rheology, double seconds, bool is_step);

/* Advance `count` cells by one time step. compression [count], metres: c on entry, out on return (see above). Returns
 * whether earlier loads still influence a cell. */
bool rheology_advance(const struct rheology_effect *rheology, const struct rheology_span *span,
                      struct rheology_state *cells, size_t count, double *compression);

#endif
