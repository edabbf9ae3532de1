#ifndef TAXEL_SIM_NEAR_PIECES_H
#define TAXEL_SIM_NEAR_PIECES_H

/* Search for the pieces of a board and the faces of a solid that may touch before the next search. */

#include <stddef.h>

#include "layer_contact.h"

/* Return an upper bound (metres) of the displacement of any piece at most `size` metres from the bracket's origin,
   between two poses of the bracket (4 x 4, by rows). */
double sim_bound_motion(const double *from, const double *to, double size);

/* Find the near pieces and faces of a board at `pose` in the solid's frame, and the motion (slack, metres) up to which
   they remain valid. A far board has no near pieces, and its slack is its clearance. */
void sim_search_near(struct sim_layer *layer, size_t board, const double *pose);

/* Return the solid with only those faces that the near pieces of a board can touch, as found by the last search. */
struct sim_solid sim_select_near_faces(const struct sim_layer *layer, size_t board);

#endif
