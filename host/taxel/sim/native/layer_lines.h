#ifndef TAXEL_SIM_LAYER_LINES_H
#define TAXEL_SIM_LAYER_LINES_H

/* Pieces of the layer as lines in the frame of the solid. */

#include "layer_contact.h"

/* Return component `row` (0, 1, 2: x, y, z) of a vector rotated by a pose (4 x 4, by rows). */
static inline double rotate_row(const double *pose, size_t row, const double *vector)
{
    return pose[4 * row] * vector[0] + pose[4 * row + 1] * vector[1] + pose[4 * row + 2] * vector[2];
}

/* Set point i of the lines to the position of a piece of a board in the solid's frame; `pose`: of the board in that
   frame. */
static inline void set_point(const struct sim_layer *layer, const double *pose, size_t piece, struct sim_lines *lines,
                             size_t i)
{
    for (size_t row = 0; row < 3; row++) {
        lines->point[row][i] = rotate_row(pose, row, layer->position + 3 * piece) + pose[4 * row + 3];
    }
}

/* Set line i to the column of a piece of a board: top of the unloaded layer and direction of the normal, in the solid's
   frame; `pose`: of the board in that frame. */
static inline void set_column(const struct sim_layer *layer, const double *pose, size_t piece, struct sim_lines *lines,
                              size_t i)
{
    set_point(layer, pose, piece, lines, i);
    for (size_t row = 0; row < 3; row++) {
        lines->direction[row][i] = rotate_row(pose, row, layer->normal + 3 * piece);
        lines->point[row][i] += layer->thickness_m * lines->direction[row][i];
    }
}

/* Set the half sides of the square of line i to those of a piece, in the solid's frame; `pose`: of the board in that
   frame. */
static inline void set_half_sides(const struct sim_layer *layer, const double *pose, size_t piece,
                                  struct sim_lines *lines, size_t i)
{
    for (size_t row = 0; row < 3; row++) {
        for (size_t side = 0; side < 2; side++) {
            lines->half[side][row][i] = rotate_row(pose, row, layer->half_sides + 6 * piece + 3 * side);
        }
    }
}

/* Return the number of lines in the next block: at most RAY_BLOCK of the `remaining` lines. */
static inline size_t limit_to_block(size_t remaining)
{
    return remaining < RAY_BLOCK ? remaining : RAY_BLOCK;
}

#endif
