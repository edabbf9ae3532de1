/* Load of the cells of a board: wrench and stiffness about the origin of the bracket. */
#ifndef EMULATOR_GEOMETRY_CONTACT_LOAD_H
#define EMULATOR_GEOMETRY_CONTACT_LOAD_H

#include "emulator/geometry/contact.h"
#include "emulator/geometry/cover_whole.h"

/* Sums of the loads of whole cells in the object's frame, one sum for each place in a square. */
struct load_sums {
    double wrench[6][SHAPE_LINES];
    double linear[3][3][SHAPE_LINES];  /* stiffness: force by translation */
    double mixed[3][3][SHAPE_LINES];   /* moment by translation */
    double turning[3][3][SHAPE_LINES]; /* moment by rotation; only the lower triangles of the first and last are set */
};

/* Cells of one square in contact. */
struct load_square {
    const struct cell *cells;
    size_t first; /* number of the first cell among those of the grip */
    const struct cover_square *places;
    const struct frame *object_from_bracket;
};

/* Add the load of cell number `cell` of a square to a load. grip: NULL: the cell carries no shear; it is a spring along
 * its normal in the centre of pressure of each face. */
void contact_load_add_cell(struct contact_load *load, const struct load_square *square, size_t cell,
                           const struct cover_load *faces, size_t count, double thickness,
                           const struct contact_grip *grip);

/* Add the loads of the whole cells of a square, which stick to the object. */
void contact_load_add_whole(struct load_sums *sums, const struct load_square *square, const struct cover_whole *whole,
                            const struct contact_grip *grip);

/* Add the sums to a load. */
void contact_load_join(struct contact_load *load, const struct load_sums *sums);

/* Rotate a load from the object's frame to the bracket's frame, and complete its stiffness, of which only the lower
 * triangle is set. */
void contact_load_turn(const struct frame *object_from_bracket, struct contact_load *load);

/* Whether the skin slides on the object: the shear force that a spring would reach exceeds the limit of friction. */
bool contact_load_slides(double reached, double limit);

/* Cell number `cell` of a placed square. */
struct cover_cell contact_load_get_cell(const struct cover_square *square, size_t cell);

#endif
