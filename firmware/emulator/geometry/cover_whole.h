/* Pressure of an object on the cells of a square that lie wholly below one face of the object: most cells in contact.
 * The values of the cells are computed side by side, so that the compiler vectorises the loops. */
#ifndef EMULATOR_GEOMETRY_COVER_WHOLE_H
#define EMULATOR_GEOMETRY_COVER_WHOLE_H

#include <stdbool.h>

#include "emulator/geometry/cover.h"

/* Cells wholly below one face, the values by coordinate: the face as in struct cover_face, the load as in struct
 * cover_load. Pressure and rate of all other cells are 0. */
struct cover_whole {
    bool is_whole[SHAPE_LINES], has_any;
    double normal[3][SHAPE_LINES], slope[SHAPE_LINES], steep[SHAPE_LINES], depth[SHAPE_LINES], change[2][SHAPE_LINES];
    double pressure[SHAPE_LINES], rate[SHAPE_LINES], centre[2][SHAPE_LINES];
};

/* Find the cells of a square that lie wholly below one face, and compute their loads, as cover_press() does for a single
 * cell. touched: result of cover_find_touched(). */
void cover_press_whole(const struct shape *shape, const struct cover_planes *planes, const struct cover_square *square,
                       const bool touched[SHAPE_LINES], struct cover_whole *whole);

#endif
