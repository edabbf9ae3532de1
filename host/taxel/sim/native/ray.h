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

/* Indentations of a block of columns: depth (metres, 0 or less without contact) and outward unit normal of the solid's
   surface, by coordinate. */
struct sim_indentations {
    double depth[RAY_BLOCK];
    double normal[3][RAY_BLOCK];
};

/* Indentation of columns of the layer whose tops are the points of the lines and whose axes are their directions: the
   distance from the top to the surface of the solid, measured against the axis. A surface that is steeper than
   `min_slope` (cosine of the angle between its inward normal and the axis) counts as if it had this slope, so that a
   column that enters the solid sideways is loaded gradually. */
void sim_indent(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double min_slope,
                struct sim_indentations *result);

/* Lower bound of the distance from each point to the solid, metres. Its change is at most the motion of the point. */
void sim_distance_bounds(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *bound);

/* Largest height of the points over one half-space of a polytope, metres; negative behind the face. */
double sim_max_height(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count);

#endif
