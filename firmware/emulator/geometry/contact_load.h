/* Load of the cells of a board: wrench (force and moment) and stiffness (their negative derivative with respect to a
 * small rigid motion) about the origin of the bracket. A square consists of the 4 x 4 cells of a taxel or margin. A
 * whole cell lies wholly below one face of the object. */
#ifndef EMULATOR_GEOMETRY_CONTACT_LOAD_H
#define EMULATOR_GEOMETRY_CONTACT_LOAD_H

#include "emulator/geometry/contact.h"
#include "emulator/geometry/cover_whole.h"

/* Sums of the loads of whole cells in the object's frame. One sum for each of the 16 places in a square, so that the
 * loops over a square vectorise. */
struct load_sums {
    double wrench[6][SHAPE_LINES];
    /* Stiffness. Only the lower triangles of `linear` and `turning` are set. */
    double linear[3][3][SHAPE_LINES];  /* force by translation */
    double mixed[3][3][SHAPE_LINES];   /* moment by translation */
    double turning[3][3][SHAPE_LINES]; /* moment by rotation */
};

/* Cells of one square in contact. */
struct load_square {
    const struct cell *cells;
    size_t first;                      /* number of the first cell in the arrays of the grip */
    const struct cover_square *places; /* the cells in the object's frame */
    const struct frame *object_from_bracket;
};

/* Add the load of cell number `cell` (0 to 15) of a square to the load of a board. faces: the `count` faces of the
 * object that press on the cell. thickness: layer above the electrode, metres. grip: friction; if NULL, the cell
 * carries no shear and is a spring along its normal in the centre of pressure of each face. */
void contact_load_add_cell(struct contact_load *load, const struct load_square *square, size_t cell,
                           const struct cover_load *faces, size_t count, double thickness,
                           const struct contact_grip *grip);

/* Add the loads of the whole cells of a square to the sums. The cells stick to the object or slide on it; the points
 * where they stick are updated if the grip advances. */
void contact_load_add_whole(struct load_sums *sums, const struct load_square *square, const struct cover_whole *whole,
                            const struct contact_grip *grip);

/* Add the sums of the whole cells to the load of a board. */
void contact_load_join(struct contact_load *load, const struct load_sums *sums);

/* Rotate a load from the object's frame to the bracket's frame, and complete its stiffness, of which only the lower
 * triangle is set. */
void contact_load_turn(const struct frame *object_from_bracket, struct contact_load *load);

/* Return whether the skin slides on the object: the shear force `reached` (newtons) without sliding exceeds `limit`,
 * the friction coefficient times the normal force. */
bool contact_load_slides(double reached, double limit);

/* Return cell number `cell` (0 to 15) of a square whose values are stored by coordinate. */
struct cover_cell contact_load_get_cell(const struct cover_square *square, size_t cell);

#endif
