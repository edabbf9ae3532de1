/* Shape of an object: a convex polyhedron given by its planes, or a cylinder that stands on its base. */
#ifndef EMULATOR_GEOMETRY_SHAPE_H
#define EMULATOR_GEOMETRY_SHAPE_H

#include <stddef.h>

#define SHAPE_PLANES_MAX 512
#define SHAPE_NAME_MAX 40

enum shape_kind {
    SHAPE_CONVEX,
    SHAPE_CYLINDER,
};

struct shape {
    char name[SHAPE_NAME_MAX];
    enum shape_kind kind;
    double centre[3], bound; /* bounding sphere, object frame, metres */
    size_t plane_count;
    double planes[SHAPE_PLANES_MAX][4]; /* unit outward normal, offset: inside is normal . p <= offset */
    double radius, height;              /* of a cylinder about z, its base at 0 */
};

/* Return the distance (metres) along the unit vector `direction` from `origin` to the point where the line enters the
 * shape: negative if the origin lies beyond that point, INFINITY if the line misses the shape. Points and directions in
 * the object's frame. */
double shape_entry(const struct shape *shape, const double origin[3], const double direction[3]);

#define SHAPE_LINES 16

/* A group of 16 lines (the normals of the 16 cells of a square of skin) whose origins all lie within `radius` of
 * `middle`. */
struct shape_lines {
    double origin[3][SHAPE_LINES], direction[3][SHAPE_LINES];
    double middle[3], radius;
    double entry[SHAPE_LINES]; /* result of shape_entry() if it is within `reach`; otherwise any value beyond `reach` */
};

/* Compute `entry` of each line: the distance (metres) from its origin to the point where it enters the shape, as
 * shape_entry(). A result beyond `reach` may be wrong, but is never less than `reach`. */
void shape_entries(const struct shape *shape, struct shape_lines *lines, double reach);

/* Return a lower bound (metres) of the distance from a point to the shape; 0 or less for points that may lie inside. */
double shape_distance_bound(const struct shape *shape, const double point[3]);

/* Return the distance (metres) from a point inside the shape to its nearest plane or surface, and write the outward
 * unit normal there; 0 or less for a point outside. Object frame. */
double shape_wall(const struct shape *shape, const double point[3], double normal[3]);

#endif
