/* Intersection of blocks of lines with a convex solid. Frame of the solid and formulas: taxel.grasp.shapes. */
#ifndef TAXEL_SIM_RAY_H
#define TAXEL_SIM_RAY_H

#include <stddef.h>

#define RAY_BLOCK 64 /* lines of a block: their data fit into the first-level cache */

/* A polytope of `faces` half-spaces normal . p <= offset (unit normals, metres); faces == 0: an upright cylinder. */
struct sim_solid {
    size_t faces;
    const double *normals; /* [faces][3] */
    const double *offsets; /* [faces] */
    double radius;
    double height;
};

/* At most RAY_BLOCK lines in the solid's frame: points and unit directions, by coordinate. */
struct sim_lines {
    double point[3][RAY_BLOCK];
    double direction[3][RAY_BLOCK];
};

/* Signed distance along each line from its point to the entry into the solid, metres: negative for a point inside,
   INFINITY if the line misses the solid or the whole solid lies behind the point. */
void sim_entries(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *entry);

/* Lower bound of the distance from each point to the solid, metres. Its change is at most the motion of the point. */
void sim_distance_bounds(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *bound);

/* Largest height of the points over one half-space of a polytope, metres; negative behind the face. */
double sim_max_height(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count);

#endif
