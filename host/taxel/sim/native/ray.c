#include "ray.h"

#include <math.h>

#define CYLINDER_FACES 3 /* wall, bottom, top */

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

size_t sim_count_faces(const struct sim_solid *solid)
{
    return solid->faces ? solid->faces : CYLINDER_FACES;
}

/* Return the scalar product of a vector and vector i of a block, which is stored by component. */
static double project(const double *vector, const double block[3][RAY_BLOCK], size_t i)
{
    return vector[0] * block[0][i] + vector[1] * block[1][i] + vector[2] * block[2][i];
}

/* Set slope, depth and change of depth in the view of a plane from the square of line i; the normal in `view` is set
   already. distance: perpendicular distance of the top of line i below the plane, metres. */
static void view_plane(const struct sim_lines *lines, size_t i, double distance, double min_slope,
                       struct sim_face *view)
{
    view->slope = -project(view->normal, lines->direction, i);
    view->limited = larger(view->slope, min_slope);
    view->depth = distance / view->limited;
    for (size_t side = 0; side < 2; side++) {
        view->change[side] = -project(view->normal, lines->half[side], i) / view->limited;
    }
}

/* Compute the view of an upright cylinder's wall: line i, followed against its direction, leaves the wall at the depth
   d with |(x, y) - d (dx, dy)| = radius, which is a quadratic equation. If the wall is too steep there, the depth is
   the radial distance to the wall divided by min_slope. */
static void view_wall(const struct sim_solid *solid, const struct sim_lines *lines, size_t i, double min_slope,
                      struct sim_face *view)
{
    const double x = lines->point[0][i], y = lines->point[1][i];
    const double dx = lines->direction[0][i], dy = lines->direction[1][i];
    const double distance = sqrt(x * x + y * y), wall = solid->radius - distance;
    const double a = dx * dx + dy * dy, b = x * dx + y * dy;
    double depth = INFINITY;
    if (wall > 0.0 && a > 0.0) {
        depth = (b + sqrt(b * b + a * (solid->radius + distance) * wall)) / a;
    }
    const int is_crossed = depth < wall / min_slope;
    view->normal[0] = is_crossed ? (x - depth * dx) / solid->radius : distance > 0.0 ? x / distance : 1.0;
    view->normal[1] = is_crossed ? (y - depth * dy) / solid->radius : distance > 0.0 ? y / distance : 0.0;
    view->normal[2] = 0.0;
    view_plane(lines, i, wall, min_slope, view);
    if (wall > 0.0) {
        view->depth = is_crossed ? depth : wall / min_slope;
    }
}

/* Compute the view of one face from the square of line i: a face of a polytope, or the wall (0), the bottom (1) or the
   top (2) of an upright cylinder that stands on z = 0. */
void sim_view_face(const struct sim_solid *solid, size_t face, const struct sim_lines *lines, size_t i,
                   double min_slope, struct sim_face *view)
{
    if (solid->faces) {
        for (size_t k = 0; k < 3; k++) {
            view->normal[k] = solid->normals[3 * face + k];
        }
        view_plane(lines, i, solid->offsets[face] - project(view->normal, lines->point, i), min_slope, view);
    } else if (face == 0) {
        view_wall(solid, lines, i, min_slope, view);
    } else {
        const double z = lines->point[2][i];
        view->normal[0] = view->normal[1] = 0.0;
        view->normal[2] = face == 1 ? -1.0 : 1.0;
        view_plane(lines, i, face == 1 ? z : solid->height - z, min_slope, view);
    }
}

/* Update the ranges of column i by a face whose depths over the column's square are between `low` and `high`. */
static inline void add_range(struct sim_ranges *ranges, size_t i, size_t face, double low, double high)
{
    const int is_lowest = low < ranges->lower[i];
    ranges->second[i] = is_lowest ? ranges->lower[i] : smaller(low, ranges->second[i]);
    ranges->face[i] = is_lowest ? (double)face : ranges->face[i];
    ranges->lower[i] = is_lowest ? low : ranges->lower[i];
    ranges->upper[i] = smaller(high, ranges->upper[i]);
}

/* Add one face of a polytope to the ranges of a block of columns. */
static void add_polytope_face(const struct sim_solid *solid, size_t face, const struct sim_lines *lines, size_t count,
                              double min_slope, struct sim_ranges *ranges)
{
    const double *n = solid->normals + 3 * face, offset = solid->offsets[face];
    for (size_t i = 0; i < count; i++) {
        const double limited = larger(-project(n, lines->direction, i), min_slope);
        const double depth = (offset - project(n, lines->point, i)) / limited;
        /* The depth is linear over the square, so that it differs most from the depth at the middle in the corners. */
        const double extent = (fabs(project(n, lines->half[0], i)) + fabs(project(n, lines->half[1], i))) / limited;
        add_range(ranges, i, face, depth - extent, depth + extent);
    }
}

/* Compute bounds of the depths (metres) of a block of columns over their squares; see struct sim_ranges. */
void sim_bound_depths(const struct sim_solid *solid, const struct sim_lines *lines, size_t count, double min_slope,
                      struct sim_ranges *ranges)
{
    for (size_t i = 0; i < count; i++) {
        ranges->lower[i] = ranges->second[i] = ranges->upper[i] = INFINITY;
        ranges->face[i] = 0.0;
    }
    for (size_t face = 0; face < solid->faces; face++) {
        add_polytope_face(solid, face, lines, count, min_slope, ranges);
    }
    for (size_t i = 0; i < count && !solid->faces; i++) {
        for (size_t face = 0; face < CYLINDER_FACES; face++) {
            struct sim_face view;
            sim_view_face(solid, face, lines, i, min_slope, &view);
            const double extent = fabs(view.change[0]) + fabs(view.change[1]);
            add_range(ranges, i, face, view.depth - extent, view.depth + extent);
        }
    }
}

/* Return the signed distance (metres) of a point from the surface of an upright cylinder; negative inside. */
static double cylinder_distance(const struct sim_solid *solid, double x, double y, double z)
{
    const double radial = sqrt(x * x + y * y) - solid->radius;
    const double axial = fabs(z - solid->height / 2.0) - solid->height / 2.0;
    const double over_wall = larger(radial, 0.0), over_cap = larger(axial, 0.0);
    return sqrt(over_wall * over_wall + over_cap * over_cap) + smaller(larger(radial, axial), 0.0);
}

/* Compute the heights (metres) of a block of points over the plane of one face; negative behind the face. */
static void compute_heights(const struct sim_solid *solid, size_t face, const struct sim_lines *lines, size_t count,
                            double *height)
{
    const double *normal = solid->normals + 3 * face;
    const double x = normal[0], y = normal[1], z = normal[2], offset = solid->offsets[face];
    for (size_t i = 0; i < count; i++) {
        height[i] = x * lines->point[0][i] + y * lines->point[1][i] + z * lines->point[2][i] - offset;
    }
}

/* Compute a lower bound (metres) of the distance from each point to the solid: exact for a cylinder, the largest height
   over any half-space for a polytope. */
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

/* Return the largest height (metres) of a block of points over one face of a polytope; negative if all points lie
   behind the face. */
double sim_max_height(const struct sim_solid *polytope, size_t face, const struct sim_lines *lines, size_t count)
{
    double height[RAY_BLOCK], max_height = -INFINITY;
    compute_heights(polytope, face, lines, count, height);
    for (size_t i = 0; i < count; i++) {
        max_height = larger(max_height, height[i]);
    }
    return max_height;
}
