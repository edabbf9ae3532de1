/* Pressure of an object on one cell of the skin, also where an edge of the object crosses the cell. A face is a flat
 * side of a polyhedron, or the wall or a cap of a cylinder; over one cell, the wall is replaced by a tangent plane. */
#ifndef EMULATOR_GEOMETRY_COVER_H
#define EMULATOR_GEOMETRY_COVER_H

#include <stdbool.h>
#include <stddef.h>

#include "emulator/geometry/shape.h"

/* Smallest cosine of the angle between a cell and a face at which the face compresses the cell by its whole depth: 60
 * degrees. A steeper face is treated as inclined by this angle, so that an object that enters a cell from the side
 * compresses the cell gradually. */
#define COVER_STEEPEST 0.5
#define COVER_WALL_STEPS 2 /* steps of Newton's method to the wall of a cylinder; error in a grasp: below 1 nm */
#define COVER_GAUSS_TWO 0.57735026918962576 /* points of Gauss's rule of order 2, in halves of the interval */
#define COVER_FACES_MAX 64 /* an indenter with a finely divided round surface has tens of faces over one cell */

/* Cell in the object's frame: middle of the surface of the unloaded layer, outward normal, half sides (metres). */
struct cover_cell {
    double top[3], normal[3], half[2][3];
};

/* The values of struct cover_cell for the 16 cells of one square (a taxel or margin), stored by coordinate so that
 * loops over the cells vectorise. */
struct cover_square {
    double top[3][SHAPE_LINES], normal[3][SHAPE_LINES], half[2][3][SHAPE_LINES];
};

/* Faces of a polyhedron that a group of cells can touch: indices of the planes of the shape. Unused for a cylinder. */
struct cover_planes {
    size_t count;
    size_t index[SHAPE_PLANES_MAX];
};

/* Face of the object over a cell. The depth is the distance from the middle of the cell's top down to the plane of the
 * face, against the normal of the cell, in metres; positive inside the object. */
struct cover_face {
    double normal[3];        /* outward */
    double slope;            /* cosine between the inward normal and the normal of the cell */
    double steep;            /* slope, at least COVER_STEEPEST */
    double depth, change[2]; /* change: of the depth from the middle along each half side, metres */
};

/* Load of one face on a cell: integrals over the part of the cell below the face, divided by the area of the cell. */
struct cover_load {
    struct cover_face face;
    double share;     /* share of the cell's area that lies below the face */
    double pressure;  /* mean pressure, pascal */
    double rate;      /* mean derivative of the pressure with respect to the depth, pascal per metre */
    double centre[2]; /* centre of pressure, in half sides */
};

/* Collect the planes of a polyhedron that cells within `radius` (metres) of the point `middle` can touch, up to
 * `deepest` metres below the surface of the object; all planes if none is so near. */
void cover_find_planes(const struct shape *shape, const double middle[3], double radius, double deepest,
                       struct cover_planes *planes);

/* Write for each cell of a square whether the object may touch it: no face has the whole cell on its outer side.
 * Returns a lower bound (metres) of the distance of all cells from the object; 0 if a cell may touch it. */
double cover_find_touched(const struct shape *shape, const struct cover_planes *planes,
                          const struct cover_square *square, bool touched[SHAPE_LINES]);

/* Compute the loads of the object's faces on a cell. Returns the number of loads written; 0 if the object does not
 * touch the cell. */
size_t cover_press(const struct shape *shape, const struct cover_planes *planes, const struct cover_cell *cell,
                   struct cover_load loads[COVER_FACES_MAX]);

#endif
