/* The relative rise of the permittivity above each taxel of a board, at any time.
 *
 * The rises come from the skin, or directly from the forces of the stimulus; of this board, or of another one whose
 * skin is exchanged with it; at the time of the measurement, or earlier for a board with the effect `late`. */
#ifndef EMULATOR_BOARD_FIELDS_H
#define EMULATOR_BOARD_FIELDS_H

#include <stdbool.h>
#include <stddef.h>

#include "emulator/effects/late_history.h"
#include "emulator/skin/skin.h"
#include "emulator/skin/stimulus.h"
#include "emulator/base/vtime.h"

struct board_fields {
    const struct stimulus *stimulus;
    const struct skin *skin;
    size_t source;      /* the board whose skin is measured */
    size_t first_taxel; /* of the source board in the stimulus */
    size_t taxels;
    struct late_history *history; /* NULL: without the effect `late` */
    bool tracks_changes;          /* maintain the three fields below */
    bool are_equal;               /* the fields at both ends of the present interval are equal */
    unsigned change_count;        /* intervals whose fields differ from those before */
    vtime last_change;            /* start of the latest of these intervals */
};

/* Compute the relative rise of the permittivity above one taxel, or above all taxels (rise[taxels]), at a time. */
double board_fields_rise(const struct board_fields *fields, size_t taxel, vtime time);
void board_fields_all_rises(const struct board_fields *fields, vtime time, double *rise);

/* Return whether all rises are constant around `time`. Needs `tracks_changes`. */
bool board_fields_are_constant(const struct board_fields *fields, vtime time);

/* Return the position of `time` in the present interval, 0 (start) to 1 (end). */
double board_fields_fraction(const struct board_fields *fields, vtime time);

/* Return the capacitance (farad) that contact adds to all taxels, at the start or the end of the present interval.
 * `fringe_f` points to the fringe capacitance of taxel 0; `stride` is the distance in bytes to that of the next
 * taxel. */
double board_fields_added_capacitance_f(const struct board_fields *fields, bool at_end, const double *fringe_f,
                                        size_t stride);

/* Store the fields in the history of a late board. Call before the fields are replaced. Returns 0, or -1 if out of
 * memory. */
int board_fields_remember(struct board_fields *fields, vtime now);

/* Update the tracking of changes. Call after the fields have been replaced. */
void board_fields_update(struct board_fields *fields, vtime now);

#endif
