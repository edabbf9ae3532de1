#include "ray.h"

#include <math.h>

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* Distances (metres) along the lines to their entries into a polytope: clip each line by one half-space after the other
   (Cyrus and Beck 1978). */
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
            const double clearance =
                offset - (x * lines->point[0][i] + y * lines->point[1][i] + z * lines->point[2][i]);
            const double speed = x * lines->direction[0][i] + y * lines->direction[1][i] + z * lines->direction[2][i];
            const double crossing = clearance / speed;
            const double in = speed < 0.0 ? crossing : -INFINITY;
            /* A line parallel to a face is inside or outside of the half-space over its whole length. */
            const double parallel = clearance < 0.0 ? -INFINITY : INFINITY;
            const double no_exit = speed < 0.0 ? INFINITY : parallel;
            const double out = speed > 0.0 ? crossing : no_exit;
            entry[i] = larger(entry[i], in);
            leave[i] = smaller(leave[i], out);
        }
    }
    for (size_t i = 0; i < count; i++) {
        const double end = leave[i];
        entry[i] = entry[i] <= end && end >= 0.0 ? entry[i] : INFINITY;
    }
}

/* Part of a line, from `enter` to `leave`, metres along the line. */
struct interval {
    double enter, leave;
};

static const struct interval ALWAYS = {-INFINITY, INFINITY}, NEVER = {INFINITY, -INFINITY};

/* Interval (metres) of the line (x, y) + t (dx, dy) inside an infinite upright cylinder, from the roots of a quadratic
   equation in t. */
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
    const double first = q / a, second = q == 0.0 ? first : c / q;
    return (struct interval){smaller(first, second), larger(first, second)};
}

/* Interval (metres) of the line z + t dz between the planes of the two caps, z = 0 and z = height. */
static struct interval cross_caps(double height, double z, double dz)
{
    if (dz == 0.0) {
        return z >= 0.0 && z <= height ? ALWAYS : NEVER;
    }
    const double low = -z / dz, high = (height - z) / dz;
    return (struct interval){smaller(low, high), larger(low, high)};
}

/* Distances (metres) along the lines to their entries into an upright cylinder; INFINITY for a line that misses it. */
static void enter_cylinder(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *entry)
{
    for (size_t i = 0; i < count; i++) {
        const struct interval wall = cross_wall(solid->radius, lines->point[0][i], lines->point[1][i],
                                                lines->direction[0][i], lines->direction[1][i]);
        const struct interval caps = cross_caps(solid->height, lines->point[2][i], lines->direction[2][i]);
        const double enter = larger(wall.enter, caps.enter), leave = smaller(wall.leave, caps.leave);
        entry[i] = enter <= leave && leave >= 0.0 ? enter : INFINITY;
    }
}

/* Signed distance (metres) along each line from its point to the entry into the solid; INFINITY if the line misses the
   solid or the whole solid lies behind the point. */
void sim_entries(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *entry)
{
    if (solid->faces) {
        enter_polytope(solid, lines, count, entry);
    } else {
        enter_cylinder(solid, lines, count, entry);
    }
}

/* Signed distance (metres) of a point from the surface of an upright cylinder; negative inside. */
static double cylinder_distance(const struct sim_solid *solid, double x, double y, double z)
{
    const double radial = sqrt(x * x + y * y) - solid->radius;
    const double axial = fabs(z - solid->height / 2.0) - solid->height / 2.0;
    const double over_wall = larger(radial, 0.0), over_cap = larger(axial, 0.0);
    return sqrt(over_wall * over_wall + over_cap * over_cap) + smaller(larger(radial, axial), 0.0);
}

/* Heights (metres) of a block of points over the plane of one face; negative inside the solid. */
static void compute_heights(const struct sim_solid *solid, size_t face, const struct sim_lines *lines, size_t count,
                            double *height)
{
    const double *normal = solid->normals + 3 * face;
    const double x = normal[0], y = normal[1], z = normal[2], offset = solid->offsets[face];
    for (size_t i = 0; i < count; i++) {
        height[i] = x * lines->point[0][i] + y * lines->point[1][i] + z * lines->point[2][i] - offset;
    }
}

/* Lower bound (metres) of the distance from each point to the solid: exact for a cylinder, the largest height over any
   half-space for a polytope. */
void sim_distance_bounds(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double *bound)
{
    double height[RAY_BLOCK];
    for (size_t i = 0; i < count; i++) {
        bound[i] = -INFINITY;
        if (!solid->faces) {
            bound[i] = cylinder_distance(solid, lines->point[0][i], lines->point[1][i], lines->point[2][i]);
        }
    }
    for (size_t face = 0; face < solid->faces; face++) { /* the largest height over all half-spaces is a lower bound */
        compute_heights(solid, face, lines, count, height);
        for (size_t i = 0; i < count; i++) {
            bound[i] = larger(bound[i], height[i]);
        }
    }
}

/* Largest height (metres) of a block of points over one face of a polytope; negative if all points lie behind the face.
 */
double sim_max_height(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count)
{
    double height[RAY_BLOCK], max_height = -INFINITY;
    compute_heights(polytope, face, lines, count, height);
    for (size_t i = 0; i < count; i++) {
        max_height = larger(max_height, height[i]);
    }
    return max_height;
}
