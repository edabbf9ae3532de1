/* Division of the square of a column along the edges of a solid. */
#ifndef TAXEL_SIM_DIVISION_H
#define TAXEL_SIM_DIVISION_H

#include "ray.h"

#define SIM_PARTS_MAX 64

/* Part of a square that one face indents. */
struct sim_part {
    struct sim_face face;
    double share;     /* area as a share of the area of the square */
    double centre[2]; /* centroid, in half sides from the middle of the square */
    double depth;     /* mean, metres */
    double deviation; /* standard deviation of the depth over the part, metres */
};

/* Divide the square of line i, whose depths are bounded by entry i of `ranges`, into the parts that are indented, at
   most one for each face. Returns the number of parts; 0 if the square is outside the solid. Areas and depths of the
   parts are continuous functions of the solid's pose. */
size_t sim_divide(const struct sim_solid *solid, const struct sim_lines *lines, size_t i, double min_slope,
                  const struct sim_ranges *ranges, struct sim_part parts[SIM_PARTS_MAX]);

#endif
