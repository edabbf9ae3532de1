#include "ray.h"

#include <math.h>

static double least(double a, double b)
{
    return a < b ? a : b;
}

static double greatest(double a, double b)
{
    return a > b ? a : b;
}

/* Clipped by one half-space after the other (Cyrus and Beck 1978). */
static void enter_polytope(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *entry)
{
    double leave[RAY_BLOCK];
    for (size_t i = 0; i < count; i++) {
        entry[i] = -INFINITY;
        leave[i] = INFINITY;
    }
    for (size_t face = 0; face < solid->faces; face++) {
        const double *normal = solid->normals + 3 * face;
        const double x = normal[0], y = normal[1], z = normal[2], offset = solid->offsets[face];
        for (size_t i = 0; i < count; i++) {
            const double room = offset - (x * lines->point[0][i] + y * lines->point[1][i] + z * lines->point[2][i]);
            const double speed = x * lines->direction[0][i] + y * lines->direction[1][i] + z * lines->direction[2][i];
            const double at = room / speed;
            const double in = speed < 0.0 ? at : -INFINITY;
            /* A line that runs along a face leaves nowhere, or is outside all the way. */
            const double beside = room < 0.0 ? -INFINITY : INFINITY;
            const double along = speed < 0.0 ? INFINITY : beside;
            const double out = speed > 0.0 ? at : along;
            entry[i] = greatest(entry[i], in);
            leave[i] = least(leave[i], out);
        }
    }
    for (size_t i = 0; i < count; i++) {
        const double end = leave[i];
        entry[i] = entry[i] <= end && end >= 0.0 ? entry[i] : INFINITY;
    }
}

struct interval {
    double enter, leave;
};

static const struct interval ALWAYS = {-INFINITY, INFINITY}, NEVER = {INFINITY, -INFINITY};

/* Within the endless round wall. */
static struct interval cross_wall(double radius, double x, double y, double dx, double dy)
{
    const double a = dx * dx + dy * dy, b = x * dx + y * dy, c = x * x + y * y - radius * radius;
    if (a == 0.0) {
        return c <= 0.0 ? ALWAYS : NEVER;
    }
    /* b^2 - a c by Lagrange's identity: no cancellation far from the cylinder. */
    const double moment = x * dy - y * dx;
    const double discriminant = a * radius * radius - moment * moment;
    if (discriminant < 0.0) {
        return NEVER;
    }
    const double q = -(b + copysign(sqrt(discriminant), b));
    const double one = q / a, two = q == 0.0 ? one : c / q;
    return (struct interval){least(one, two), greatest(one, two)};
}

/* Between the two caps. */
static struct interval cross_caps(double height, double z, double dz)
{
    if (dz == 0.0) {
        return z >= 0.0 && z <= height ? ALWAYS : NEVER;
    }
    const double low = -z / dz, high = (height - z) / dz;
    return (struct interval){least(low, high), greatest(low, high)};
}

static void enter_cylinder(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *entry)
{
    for (size_t i = 0; i < count; i++) {
        const struct interval wall = cross_wall(solid->radius, lines->point[0][i], lines->point[1][i],
                                                lines->direction[0][i], lines->direction[1][i]);
        const struct interval caps = cross_caps(solid->height, lines->point[2][i], lines->direction[2][i]);
        const double enter = greatest(wall.enter, caps.enter), leave = least(wall.leave, caps.leave);
        entry[i] = enter <= leave && leave >= 0.0 ? enter : INFINITY;
    }
}

void sim_entries(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *entry)
{
    if (solid->faces) {
        enter_polytope(solid, lines, count, entry);
    } else {
        enter_cylinder(solid, lines, count, entry);
    }
}

static double cylinder_distance(const struct sim_solid *solid, double x, double y, double z)
{
    const double radial = sqrt(x * x + y * y) - solid->radius;
    const double axial = fabs(z - solid->height / 2.0) - solid->height / 2.0;
    const double over_wall = greatest(radial, 0.0), over_cap = greatest(axial, 0.0);
    return sqrt(over_wall * over_wall + over_cap * over_cap) + least(greatest(radial, axial), 0.0);
}

/* Heights of the points over one half-space. */
static void heights(const struct sim_solid *solid, size_t face, const struct sim_lines *lines, size_t count,
                    double *height)
{
    const double *normal = solid->normals + 3 * face;
    const double x = normal[0], y = normal[1], z = normal[2], offset = solid->offsets[face];
    for (size_t i = 0; i < count; i++) {
        height[i] = x * lines->point[0][i] + y * lines->point[1][i] + z * lines->point[2][i] - offset;
    }
}

void sim_distance_bounds(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *bound)
{
    double height[RAY_BLOCK];
    for (size_t i = 0; i < count; i++) {
        bound[i] = -INFINITY;
        if (!solid->faces) {
            bound[i] = cylinder_distance(solid, lines->point[0][i], lines->point[1][i], lines->point[2][i]);
        }
    }
    for (size_t face = 0; face < solid->faces; face++) { /* the highest over all half-spaces */
        heights(solid, face, lines, count, height);
        for (size_t i = 0; i < count; i++) {
            bound[i] = greatest(bound[i], height[i]);
        }
    }
}

double sim_highest(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count)
{
    double height[RAY_BLOCK], highest = -INFINITY;
    heights(polytope, face, lines, count, height);
    for (size_t i = 0; i < count; i++) {
        highest = greatest(highest, height[i]);
    }
    return highest;
}
