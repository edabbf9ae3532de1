#include "emulator/geometry/shape.h"

#include <math.h>

/* Interval of a line that lies inside all half-spaces by which it has been clipped so far: distances from the origin of
 * the line, metres. */
struct span {
    double enter, leave;
};

/* Clip the interval in which a line lies inside a shape by a half-space. slope: change of the distance from the plane
 * per metre of the line. excess: distance of the origin of the line outside the plane, metres. The interval becomes
 * empty if the line lies outside. Divides only if the interval changes, because most planes do not bound it. */
static inline void clip(struct span *span, double slope, double excess)
{
    if (slope < 0.0) {
        span->enter = excess > -slope * span->enter ? -excess / slope : span->enter;
    } else if (slope > 0.0) {
        span->leave = -excess < slope * span->leave ? -excess / slope : span->leave;
    } else if (excess > 0.0) {
        span->leave = -INFINITY;
    }
}

/* Clip the interval in which the line o + t d lies inside a polyhedron by all half-spaces of the polyhedron. */
static void clip_planes(struct span *span, const struct shape *shape, const double o[3], const double d[3])
{
    for (size_t i = 0; i < shape->plane_count; i++) {
        const double *n = shape->planes[i];
        clip(span, n[0] * d[0] + n[1] * d[1] + n[2] * d[2], n[0] * o[0] + n[1] * o[1] + n[2] * o[2] - n[3]);
    }
}

/* Clip the interval in which the line o + t d lies inside an upright cylinder by the two caps and by the wall. The
 * intersections with the wall are the roots of a quadratic equation in t. */
static void clip_cylinder(struct span *span, const struct shape *shape, const double o[3], const double d[3])
{
    clip(span, -d[2], -o[2]);
    clip(span, d[2], o[2] - shape->height);
    const double a = d[0] * d[0] + d[1] * d[1];
    const double b = o[0] * d[0] + o[1] * d[1];
    const double c = o[0] * o[0] + o[1] * o[1] - shape->radius * shape->radius;
    if (a == 0.0) {
        span->leave = c > 0.0 ? -INFINITY : span->leave;
        return;
    }
    const double root = b * b - a * c;
    if (root <= 0.0) {
        span->leave = -INFINITY;
        return;
    }
    const double enter = (-b - sqrt(root)) / a, leave = (-b + sqrt(root)) / a;
    span->enter = enter > span->enter ? enter : span->enter;
    span->leave = leave < span->leave ? leave : span->leave;
}

/* Return the distance (metres) along the unit vector `direction` from `origin` to the point where the line enters the
 * shape: negative if that point lies behind the origin, INFINITY if the line misses the shape. */
double shape_entry(const struct shape *shape, const double origin[3], const double direction[3])
{
    struct span span = {-INFINITY, INFINITY};
    if (shape->kind == SHAPE_CONVEX) {
        clip_planes(&span, shape, origin, direction);
    } else {
        clip_cylinder(&span, shape, origin, direction);
    }
    return span.enter < span.leave ? span.enter : INFINITY;
}

/* Clip the intervals in which a group of lines lies inside a polyhedron by one of its planes, without branches, so
 * that the compiler vectorises the loop. */
static void clip_lines(const double *plane, const struct shape_lines *lines, double *enter, double *leave)
{
    const double (*o)[SHAPE_LINES] = lines->origin, (*d)[SHAPE_LINES] = lines->direction;
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double slope = plane[0] * d[0][i] + plane[1] * d[1][i] + plane[2] * d[2][i];
        const double excess = plane[0] * o[0][i] + plane[1] * o[1][i] + plane[2] * o[2][i] - plane[3];
        const double distance = -excess / slope;
        const double entry_distance = slope < 0.0 ? distance : -INFINITY;
        const double parallel = excess > 0.0 ? -INFINITY : INFINITY;
        const double exit_distance = slope > 0.0 ? distance : slope < 0.0 ? INFINITY : parallel;
        enter[i] = entry_distance > enter[i] ? entry_distance : enter[i];
        leave[i] = exit_distance < leave[i] ? exit_distance : leave[i];
    }
}

/* Compute the entry distances (metres) of a group of lines, as shape_entry() does for each line. Planes that are too
 * far from the group to change an entry within `reach` are skipped; results beyond `reach` may be wrong but stay beyond
 * it. */
void shape_entries(const struct shape *shape, struct shape_lines *lines, double reach)
{
    double enter[SHAPE_LINES], leave[SHAPE_LINES];
    for (int i = 0; i < SHAPE_LINES; i++) {
        enter[i] = -INFINITY;
        leave[i] = INFINITY;
        if (shape->kind == SHAPE_CYLINDER) {
            const double origin[3] = {lines->origin[0][i], lines->origin[1][i], lines->origin[2][i]};
            const double direction[3] = {lines->direction[0][i], lines->direction[1][i], lines->direction[2][i]};
            lines->entry[i] = shape_entry(shape, origin, direction);
        }
    }
    if (shape->kind == SHAPE_CYLINDER) {
        return;
    }
    for (size_t plane = 0; plane < shape->plane_count; plane++) {
        const double *n = shape->planes[plane], *p = lines->middle;
        /* Planes farther away meet no line within reach. */
        if (n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - n[3] >= -lines->radius - reach) {
            clip_lines(n, lines, enter, leave);
        }
    }
    for (int i = 0; i < SHAPE_LINES; i++) {
        lines->entry[i] = enter[i] < leave[i] ? enter[i] : INFINITY;
    }
}

/* Return a lower bound (metres) of the distance from a point to the shape: the largest distance from any of its planes
 * or surfaces; 0 or less if the point may lie inside. */
double shape_distance_bound(const struct shape *shape, const double point[3])
{
    double bound = -INFINITY;
    if (shape->kind == SHAPE_CYLINDER) {
        const double side = sqrt(point[0] * point[0] + point[1] * point[1]) - shape->radius;
        return fmax(side, fmax(-point[2], point[2] - shape->height));
    }
    for (size_t i = 0; i < shape->plane_count; i++) {
        const double *n = shape->planes[i];
        bound = fmax(bound, n[0] * point[0] + n[1] * point[1] + n[2] * point[2] - n[3]);
    }
    return bound;
}

/* Return the distance (metres) from a point to the nearest surface of an upright cylinder, positive inside, and write
 * the outward normal of this surface. */
static double cylinder_wall(const struct shape *shape, const double point[3], double normal[3])
{
    const double radius = hypot(point[0], point[1]), side = shape->radius - radius;
    const double cap = fmin(point[2], shape->height - point[2]);
    normal[0] = normal[1] = normal[2] = 0.0;
    if (cap < side) {
        normal[2] = point[2] < 0.5 * shape->height ? -1.0 : 1.0;
        return cap;
    }
    normal[0] = radius > 0.0 ? point[0] / radius : 1.0;
    normal[1] = radius > 0.0 ? point[1] / radius : 0.0;
    return side;
}

/* Return the distance (metres) from a point inside a shape to the nearest surface, and write the outward normal of this
 * surface. The result is 0 or less for a point outside. */
double shape_wall(const struct shape *shape, const double point[3], double normal[3])
{
    if (shape->kind == SHAPE_CYLINDER) {
        return cylinder_wall(shape, point, normal);
    }
    double nearest = INFINITY;
    for (size_t i = 0; i < shape->plane_count; i++) {
        const double *plane = shape->planes[i];
        const double distance = plane[3] - plane[0] * point[0] - plane[1] * point[1] - plane[2] * point[2];
        if (distance < nearest) {
            nearest = distance;
            normal[0] = plane[0];
            normal[1] = plane[1];
            normal[2] = plane[2];
        }
    }
    return nearest;
}
