/* What acts on a board's taxels at a time: of the skin, or of forces directly; of another board, of the past. */
#ifndef EMULATOR_BOARD_FIELDS_H
#define EMULATOR_BOARD_FIELDS_H

#include "emulator/effects/droop.h"
#include "emulator/effects/late_history.h"

struct board_fields {
    const struct stimulus *stimulus;
    const struct skin *skin;
    size_t source;      /* the board whose skin it is */
    size_t first_taxel; /* of that board in the stimulus */
    size_t taxels;
    struct late_history *history; /* NULL: not late */
    bool watched;     /* somebody asks whether they are still */
    bool equal;       /* the fields at both ends of the present interval are the same */
    unsigned number;  /* counts intervals that bring anything new */
    vtime changed;    /* when the last of those began */
};

/* Relative rise of the permittivity over a taxel, and over all taxels [taxels]. */
double board_fields_rise(const struct board_fields *fields, size_t taxel, vtime time);
void board_fields_rises(const struct board_fields *fields, vtime time, double *rise);

/* No field changes around that time. */
bool board_fields_are_still(const struct board_fields *fields, vtime time);

/* How far a time is from the one end of the present interval to the other, 0 to 1. */
double board_fields_fraction(const struct board_fields *fields, vtime time);

/* The capacitance, farad, that what presses the taxels adds at either end of the interval; fringe_f of taxel 0, and how many
 * bytes lie between two taxels'. */
double board_fields_load(const struct board_fields *fields, bool after, const double *fringe_f, size_t stride);

/* Before fields are replaced: a late board remembers them. Returns 0, or -1 without memory. After they have been. */
int board_fields_leave(struct board_fields *fields, vtime now);
void board_fields_enter(struct board_fields *fields, vtime now);

#endif
