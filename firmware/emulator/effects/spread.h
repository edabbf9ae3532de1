/* Lateral spread of contact in the dielectric.
 *
 * Form `film`: the tape and the cover over the pillars distribute pressure laterally. The pressure on the pillars is
 * the contact pressure smoothed with a kernel that falls to 1/e at length_m along the sheet's lines; the total force is
 * preserved. Distances are those between neighbouring cells of the sheet. Form `pillars`: a compressed pillar pulls the cover down around it. The compression falls by slope
 * (metres per metre) with the distance from every compressed cell (one of the 4 x 4 parts of a taxel), so that the
 * contact patch grows. `strength` interpolates between no effect (0) and the full effect (1). */
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

/* Neighbours of a cell that precede it on the grid. */
enum spread_neighbour {
    SPREAD_BEFORE, /* in the same row */
    SPREAD_ABOVE,
    SPREAD_ABOVE_BEFORE,
    SPREAD_ABOVE_AFTER,
    SPREAD_NEIGHBOURS,
};

/* State of one board. Film: arrays [grid size] of its patch. Pillars: arrays of a grid with a margin of one position.
 */
struct spread_state {
    double *attenuation;      /* weight between a cell and its neighbour before it in the row; NULL: not form `film` */
    double *attenuation_down; /* weight between a cell and its neighbour above it */
    double *along_row, *along_column; /* 1 / sum of the weights of a position */
    double *value;
    double *decrease[SPREAD_NEIGHBOURS]; /* pillars: of the compression from a cell to each neighbour, metres */
    double smallest_decrease;
    int32_t *grid_index_of; /* [cells]: index in the grid with a margin; NULL: not form `pillars` */
};

/* Allocate the state of one board. Returns 0, or -1 if out of memory. */
int spread_init(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch);
void spread_free(struct spread_state *state);

/* Form `pillars`: extend the compression [cells], metres, to the surroundings of compressed cells. Does nothing for the
 * form `film` or at strength 0. */
void spread_compression(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch,
                        double *compression);

/* Form `film`: smooth the pressure [cells], pascal. Does nothing for the form `pillars` or at strength 0. */
void spread_pressure(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch,
                     double *pressure);

#endif
