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

/* One face of the solid over the square of a column: the distance from the top of the column to the plane of the face,
   measured against the axis. A face whose inward normal has a smaller cosine `slope` with the axis than `min_slope`
   counts as if it had this cosine (`limited`), so that a column that enters the solid sideways is loaded gradually. */
struct sim_face {
    double depth;     /* at the middle of the square, metres; below 0: outside of the plane */
    double change[2]; /* of the depth along each half side */
    double normal[3]; /* outward */
    double slope, limited;
};

/* Bounds of the depths of a block of columns over their squares. The least depth over all faces is the indentation. */
struct sim_ranges {
    double lower[RAY_BLOCK];  /* smallest depth of any face */
    double second[RAY_BLOCK]; /* smallest depth of any other face */
    double upper[RAY_BLOCK];  /* upper bound of the indentation */
    double face[RAY_BLOCK];   /* number of the face with the smallest depth */
};

/* Number of faces of a solid: those of a polytope; wall, bottom and top of a cylinder. */
size_t sim_count_faces(const struct sim_solid *solid);

/* View of one face from the square of line i. The wall of a cylinder is replaced by its tangent plane at the axis. */
void sim_view_face(const struct sim_solid *solid, size_t face, const struct sim_lines *lines, size_t i,
                   double min_slope, struct sim_face *view);

void sim_bound_depths(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double min_slope,
                      struct sim_ranges *ranges);

/* Lower bound of the distance from each point to the solid, metres. Its change is at most the motion of the point. */
void sim_distance_bounds(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *bound);

/* Largest height of the points over one half-space of a polytope, metres; negative behind the face. */
double sim_max_height(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count);

#endif
