/* Pressure of an object on those cells of a square (the 4 x 4 cells of a taxel or margin) that lie wholly below one
 * face of the object, as most cells in contact do. The values of the 16 cells are computed side by side, so that the
 * compiler vectorises the loops. */
#ifndef EMULATOR_GEOMETRY_COVER_WHOLE_H
#define EMULATOR_GEOMETRY_COVER_WHOLE_H

#include <stdbool.h>

#include "emulator/geometry/cover.h"

/* Face and load of each cell that lies wholly below one face, stored by coordinate: the face as in struct cover_face,
 * the load as in struct cover_load. If any cell is whole, pressure and rate of the other cells are 0; without a whole
 * cell, they are not set. */
struct cover_whole {
    bool is_whole[SHAPE_LINES], has_any;
    double normal[3][SHAPE_LINES], slope[SHAPE_LINES], steep[SHAPE_LINES], depth[SHAPE_LINES], change[2][SHAPE_LINES];
    double pressure[SHAPE_LINES], rate[SHAPE_LINES], centre[2][SHAPE_LINES];
};

/* Find the cells of a square that lie wholly below one face of the object, and compute their loads, as cover_press()
 * does for a single cell. touched: which cells the object may touch, from cover_find_touched(). whole: result. */
void cover_press_whole(const struct shape *shape, const struct cover_planes *planes, const struct cover_square *square,
                       const bool touched[SHAPE_LINES], struct cover_whole *whole);

#endif
