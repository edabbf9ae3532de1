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

/* Indentations by a polytope: the smallest one over all faces. */
static void indent_by_polytope(const struct sim_solid *solid, const struct sim_lines *lines, size_t count,
                               double min_slope, struct sim_indentations *result)
{
    for (size_t i = 0; i < count; i++) {
        result->depth[i] = INFINITY;
    }
    for (size_t face = 0; face < solid->faces; face++) {
        const double *normal = solid->normals + 3 * face;
        const double x = normal[0], y = normal[1], z = normal[2], offset = solid->offsets[face];
        for (size_t i = 0; i < count; i++) {
            const double distance = offset - (x * lines->point[0][i] + y * lines->point[1][i] + z * lines->point[2][i]);
            const double slope =
                -(x * lines->direction[0][i] + y * lines->direction[1][i] + z * lines->direction[2][i]);
            const double depth = distance / larger(slope, min_slope);
            const int is_smaller = depth < result->depth[i];
            result->depth[i] = is_smaller ? depth : result->depth[i];
            result->normal[0][i] = is_smaller ? x : result->normal[0][i];
            result->normal[1][i] = is_smaller ? y : result->normal[1][i];
            result->normal[2][i] = is_smaller ? z : result->normal[2][i];
        }
    }
}

/* Indentation of one column by the wall of an infinite upright cylinder. (x, y): top, (dx, dy): direction of the axis,
   across the cylinder. The line against the axis leaves the wall at the root of a quadratic equation. */
static double indent_by_wall(double radius, double x, double y, double dx, double dy, double min_slope, double *normal)
{
    const double distance = sqrt(x * x + y * y), wall = radius - distance;
    const double limit = wall / min_slope;
    const double a = dx * dx + dy * dy, b = x * dx + y * dy;
    double depth = INFINITY;
    if (wall > 0.0 && a > 0.0) {
        depth = (b + sqrt(b * b + a * (radius + distance) * wall)) / a;
    }
    if (depth < limit) {
        normal[0] = (x - depth * dx) / radius;
        normal[1] = (y - depth * dy) / radius;
        return depth;
    }
    normal[0] = distance > 0.0 ? x / distance : 1.0;
    normal[1] = distance > 0.0 ? y / distance : 0.0;
    return limit;
}

/* Indentations by an upright cylinder: the smallest one of wall and caps. */
static void indent_by_cylinder(const struct sim_solid *solid, const struct sim_lines *lines, size_t count,
                               double min_slope, struct sim_indentations *result)
{
    for (size_t i = 0; i < count; i++) {
        const double z = lines->point[2][i], dz = lines->direction[2][i];
        double normal[3] = {0.0, 0.0, 0.0};
        double depth = indent_by_wall(solid->radius, lines->point[0][i], lines->point[1][i], lines->direction[0][i],
                                      lines->direction[1][i], min_slope, normal);
        const double bottom = z / larger(dz, min_slope), top = (solid->height - z) / larger(-dz, min_slope);
        if (smaller(bottom, top) < depth) {
            depth = smaller(bottom, top);
            normal[0] = normal[1] = 0.0;
            normal[2] = bottom < top ? -1.0 : 1.0;
        }
        result->depth[i] = depth;
        for (size_t k = 0; k < 3; k++) {
            result->normal[k][i] = normal[k];
        }
    }
}

/* Indentation (metres) of each column, and the normal of the surface that causes it; see ray.h. */
void sim_indent(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double min_slope,
                struct sim_indentations *result)
{
    if (solid->faces) {
        indent_by_polytope(solid, lines, count, min_slope, result);
    } else {
        indent_by_cylinder(solid, lines, count, min_slope, result);
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
