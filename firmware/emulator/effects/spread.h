/* Contact spreads sideways through the dielectric.
 *
 * Form `film`: the tape and the cover over the pillars carry pressure sideways; the pressure that reaches the pillars is that
 * of the contact, smoothed with a kernel that falls to 1/e at length_m along the sheet's lines, force kept.
 * Form `pillars`: a pressed pillar pulls the cover down beside it; the compression falls by slope (metres a metre) from
 * every pressed cell, as far as that goes, so that the contact patch grows.
 * `strength` mixes: 0 none, 1 all of it. */
#ifndef EMULATOR_EFFECTS_SPREAD_H
#define EMULATOR_EFFECTS_SPREAD_H

#include <stdbool.h>
#include <stdint.h>

struct effect_line;
struct effects;
struct patch;

enum spread_form {
    SPREAD_FILM,
    SPREAD_PILLARS,
};

struct spread_effect {
    enum spread_form form;
    double length_m; /* film */
    double slope;    /* pillars */
    double strength;
};

int spread_read(struct effect_line *line, struct effects *effects);
bool spread_is_on(const struct spread_effect *spread);

/* What one board needs. Film: all [grid places] of its patch. Pillars: of a grid with a margin of one place around it. */
struct spread_state {
    double *keep;                     /* of a neighbour's share, 0 without a cell; NULL: off */
    double *along_row, *along_column; /* 1 / sum of a place's weights */
    double *value;
    double *wall;      /* 0 at a cell, -INFINITY elsewhere; NULL: no pillars */
    int32_t *place_of; /* [cells]: where on the grid with a margin */
};

/* Returns 0, or -1 without memory. */
int spread_init(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch);
void spread_free(struct spread_state *state);

/* Pillars: grow the compression [cells], metres. Film: smooth the pressure [cells], pascal. Each does nothing in the other
 * form or at strength 0. */
void spread_compression(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch,
                        double *compression);
void spread_pressure(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch, double *pressure);

#endif
