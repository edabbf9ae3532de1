/* Lines against a convex solid, many at a time. The solid's frame and its formulas are those of taxel.grasp.shapes. */
#ifndef TAXEL_SIM_RAY_H
#define TAXEL_SIM_RAY_H

#include <stddef.h>

#define RAY_BLOCK 64 /* lines that are clipped at a time: their numbers stay in the first cache */

/* A polytope of `faces` half-spaces normal . p <= offset (unit normals, metres), or with none an upright cylinder. */
struct sim_solid {
    size_t faces;
    const double *normals; /* [faces][3] */
    const double *offsets; /* [faces] */
    double radius;
    double height;
};

/* Up to RAY_BLOCK lines by coordinate, in the solid's frame: points and unit directions. */
struct sim_lines {
    double point[3][RAY_BLOCK];
    double direction[3][RAY_BLOCK];
};

/* Signed distance from each point along its line to where the line enters the solid, metres: negative inside,
   INFINITY where the line misses or the solid lies wholly behind the point. */
void sim_entries(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *entry);

/* What the distance from each point to the solid is at least, metres; it changes no faster than the point moves. */
void sim_distance_bounds(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *bound);

/* The greatest height of the points over one half-space of a polytope, metres: below 0 behind its face. */
double sim_highest(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count);

#endif
