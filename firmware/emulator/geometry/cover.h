/* Pressure of an object on one cell of the skin, also where an edge of the object crosses the cell. */
#ifndef EMULATOR_GEOMETRY_COVER_H
#define EMULATOR_GEOMETRY_COVER_H

#include <stdbool.h>
#include <stddef.h>

#include "emulator/geometry/shape.h"

/* Smallest cosine between the normals of cell and object at which the object compresses the cell in full. A steeper face
 * counts as inclined by this angle, so that an object that enters a cell from the side compresses the cell gradually. */
#define COVER_STEEPEST 0.5
#define COVER_WALL_STEPS 2 /* of Newton's method to the wall of a cylinder; the error is below a nanometre in a grasp */
#define COVER_GAUSS_TWO 0.57735026918962576 /* points of Gauss's rule of order 2, in halves of the interval */
#define COVER_FACES_MAX 64 /* an indenter with a finely divided round surface has tens of faces over one cell */

/* Cell in the object's frame: middle of the surface of the unloaded layer, outward normal, half sides (metres). */
struct cover_cell {
    double top[3], normal[3], half[2][3];
};

/* The same values of the cells of one square, by coordinate. */
struct cover_square {
    double top[3][SHAPE_LINES], normal[3][SHAPE_LINES], half[2][3][SHAPE_LINES];
};

/* Faces of an object that a group of cells can touch: indices of the planes of a polyhedron. Unused for a cylinder. */
struct cover_planes {
    size_t count;
    size_t index[SHAPE_PLANES_MAX];
};

/* Face of the object over a cell: depth of its plane below the top, against the normal of the cell (metres, at the
 * middle), and the change of the depth along each half side. */
struct cover_face {
    double normal[3]; /* outward */
    double slope;     /* cosine between the inward normal and the normal of the cell */
    double steep;     /* slope, at least STEEPEST */
    double depth, change[2];
};

/* Load of one face on a cell. Integrals are divided by the area of the cell. */
struct cover_load {
    struct cover_face face;
    double share;     /* of the area of the cell below the face */
    double pressure;  /* integral of the pressure, pascal */
    double rate;      /* integral of the derivative of the pressure by the depth, pascal per metre */
    double centre[2]; /* centre of pressure, in half sides */
};

/* Collect the planes that the cells within `radius` of `middle` can touch, up to `deepest` metres below the surface. */
void cover_find_planes(const struct shape *shape, const double middle[3], double radius, double deepest,
                       struct cover_planes *planes);

/* Write for each cell of a square whether the object may touch it: no face lies outside of the whole cell. Returns a lower
 * bound of the distance (metres) of all cells from the object; 0 if a cell may touch it. */
double cover_find_touched(const struct shape *shape, const struct cover_planes *planes,
                          const struct cover_square *square, bool touched[SHAPE_LINES]);

/* Compute the loads of the faces on a cell. Returns their number, 0 if the object does not touch the cell. */
size_t cover_press(const struct shape *shape, const struct cover_planes *planes, const struct cover_cell *cell,
                   struct cover_load loads[COVER_FACES_MAX]);

#endif
