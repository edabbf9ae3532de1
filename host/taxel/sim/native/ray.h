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

/* At most RAY_BLOCK lines in the solid's frame: points and unit directions, by coordinate. A line is the axis of a
   column, whose square extends from -half to +half along both half sides. */
struct sim_lines {
    double point[3][RAY_BLOCK];
    double direction[3][RAY_BLOCK];
    double half[2][3][RAY_BLOCK];
};

/* View of one face of the solid from the square of a column. The depth is the distance from the top of the column to
   the plane of the face, measured against the axis. A face whose inward normal has a smaller cosine with the axis than
   `min_slope` is treated as if it had this cosine: a column that enters the solid sideways is loaded gradually. */
struct sim_face {
    double depth;     /* at the middle of the square, metres; below 0: outside the plane */
    double change[2]; /* change of the depth from the middle along each half side, metres */
    double normal[3]; /* outward */
    double slope;     /* cosine between the inward normal and the axis of the column */
    double limited;   /* `slope`, but at least min_slope */
};

/* Bounds of the depths of a block of columns over their squares; an indentation is the smallest depth of any face. */
struct sim_ranges {
    double lower[RAY_BLOCK];  /* smallest depth of any face */
    double second[RAY_BLOCK]; /* smallest depth of any other face */
    double upper[RAY_BLOCK];  /* upper bound of the indentation */
    double face[RAY_BLOCK];   /* number of the face with the smallest depth */
};

/* Return the number of faces of a solid; a cylinder has three: wall, bottom and top. */
size_t sim_count_faces(const struct sim_solid *solid);

/* Compute the view of one face from the square of line i. The wall of a cylinder is replaced by its tangent plane at
   the axis of the line. */
void sim_view_face(const struct sim_solid *solid, size_t face, const struct sim_lines *lines, size_t i,
                   double min_slope, struct sim_face *view);

/* Compute bounds of the depths of the first `count` columns over their squares. */
void sim_bound_depths(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double min_slope,
                      struct sim_ranges *ranges);

/* Compute a lower bound of the distance from each point to the solid, metres. When a point moves, its bound changes by
   at most the length of the motion. */
void sim_distance_bounds(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *bound);

/* Return the largest height of the points over one face of a polytope, metres; negative if all are behind the face. */
double sim_max_height(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count);

#endif
