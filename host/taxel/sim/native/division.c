#include "division.h"

#include <math.h>

#define VERTICES_MAX (4 + SIM_PARTS_MAX)
#define SQUARE_AREA 4.0 /* in squared half sides */
#define MIN_SHARE 1e-12 /* smaller parts are due to rounding */

/* Convex polygon in half sides from the middle of the square. */
struct polygon {
    size_t count;
    double point[VERTICES_MAX][2];
};

/* Return the depth (metres) below the plane of a face at a point of the square (in half sides from its middle). */
static double evaluate(const struct sim_face *face, const double point[2])
{
    return face->depth + face->change[0] * point[0] + face->change[1] * point[1];
}

/* Cut off the part of a polygon in which a linear function with the given values at the vertices is negative. */
static void clip(struct polygon *polygon, const double *value)
{
    struct polygon clipped = {0, {{0.0}}};
    for (size_t i = 0; i < polygon->count; i++) {
        const size_t next = i + 1 < polygon->count ? i + 1 : 0;
        const double *from = polygon->point[i], *to = polygon->point[next];
        if (value[i] >= 0.0) {
            clipped.point[clipped.count][0] = from[0];
            clipped.point[clipped.count++][1] = from[1];
        }
        if ((value[i] >= 0.0) != (value[next] >= 0.0)) {
            const double fraction = value[i] / (value[i] - value[next]);
            clipped.point[clipped.count][0] = from[0] + fraction * (to[0] - from[0]);
            clipped.point[clipped.count++][1] = from[1] + fraction * (to[1] - from[1]);
        }
    }
    *polygon = clipped;
}

/* Cut off the part of a polygon in which the depth below the plane of `face` is negative: there the square is outside
   the solid. */
static void clip_outside(struct polygon *polygon, const struct sim_face *face)
{
    double value[VERTICES_MAX];
    for (size_t i = 0; i < polygon->count; i++) {
        value[i] = evaluate(face, polygon->point[i]);
    }
    clip(polygon, value);
}

/* Cut off the part of a polygon in which the depth below another face is smaller than below `face`. If both depths are
   equal everywhere, the polygon is kept for the face that is `first`, and emptied for the other one. */
static void clip_deeper(struct polygon *polygon, const struct sim_face *face, const struct sim_face *other, int first)
{
    double value[VERTICES_MAX];
    int is_equal = 1;
    for (size_t i = 0; i < polygon->count; i++) {
        value[i] = evaluate(other, polygon->point[i]) - evaluate(face, polygon->point[i]);
        is_equal = is_equal && value[i] == 0.0;
    }
    if (is_equal && !first) {
        polygon->count = 0;
    } else {
        clip(polygon, value);
    }
}

/* Compute area share, centroid, and mean and standard deviation of the depth of a polygon, as sums over the triangles
   from its first vertex, and store them in `part`, whose face is set. Returns 0 if the polygon is empty, else 1. The
   integral of the squared depth over a triangle with the corner depths d is area (sum of d^2 + (sum of d)^2) / 12. */
static int measure(const struct polygon *polygon, struct sim_part *part)
{
    double area = 0.0, square = 0.0;
    const double *a = polygon->point[0];
    part->depth = part->centre[0] = part->centre[1] = 0.0;
    for (size_t i = 2; i < polygon->count; i++) {
        const double *b = polygon->point[i - 1], *c = polygon->point[i];
        const double triangle = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
        const double depth[3] = {evaluate(&part->face, a), evaluate(&part->face, b), evaluate(&part->face, c)};
        const double sum = depth[0] + depth[1] + depth[2];
        const double squares = depth[0] * depth[0] + depth[1] * depth[1] + depth[2] * depth[2];
        area += triangle;
        part->depth += triangle * sum / 3.0;
        square += triangle * (squares + sum * sum) / 12.0;
        for (size_t k = 0; k < 2; k++) {
            part->centre[k] += triangle * (a[k] + b[k] + c[k]) / 3.0;
        }
    }
    part->share = area / SQUARE_AREA;
    if (part->share < MIN_SHARE) {
        return 0;
    }
    part->depth /= area;
    part->centre[0] /= area;
    part->centre[1] /= area;
    const double variance = square / area - part->depth * part->depth;
    part->deviation = variance > 0.0 ? sqrt(variance) : 0.0;
    return 1;
}

/* Set share, centre, mean depth and standard deviation of the depth of a part that is the whole square: one face of the
   solid, `part->face`, indents it everywhere. The depth is then a linear function of two coordinates between -1 and 1
   (half sides), each with the variance 1 / 3. */
static void set_whole(struct sim_part *part)
{
    const double *change = part->face.change;
    part->share = 1.0;
    part->centre[0] = part->centre[1] = 0.0;
    part->depth = part->face.depth;
    part->deviation = sqrt((change[0] * change[0] + change[1] * change[1]) / 3.0);
}

/* Find the faces below which the depth may be smallest somewhere in the square of line i. Stores at most SIM_PARTS_MAX
   of them; returns their number. upper: upper bound of the smallest depth, metres. */
static size_t find_candidates(const struct sim_solid *solid, const struct sim_lines *lines, size_t i, double min_slope,
                              double upper, struct sim_face candidates[SIM_PARTS_MAX])
{
    const size_t faces = sim_count_faces(solid);
    size_t count = 0;
    for (size_t face = 0; face < faces && count < SIM_PARTS_MAX; face++) {
        struct sim_face *view = &candidates[count];
        sim_view_face(solid, face, lines, i, min_slope, view);
        /* The compared value is the smallest depth in the square. A view that is not counted is overwritten. */
        count += view->depth - fabs(view->change[0]) - fabs(view->change[1]) <= upper;
    }
    return count;
}

/* Divide the square of line i into the parts that each face of the solid indents, and return their number; 0 if the
   square is outside the solid. A face indents the points of the square at which its depth is the smallest of all. The
   `ranges` of the depths show whether a single face indents the whole square. */
size_t sim_divide(const struct sim_solid *solid, const struct sim_lines *lines, size_t i, double min_slope,
                  const struct sim_ranges *ranges, struct sim_part parts[SIM_PARTS_MAX])
{
    struct sim_face candidates[SIM_PARTS_MAX];
    size_t stored = 0;
    if (ranges->upper[i] <= 0.0) {
        return 0;
    }
    /* The whole square is inside the solid, and the depth below one face is everywhere the smallest. */
    if (ranges->lower[i] >= 0.0 && ranges->second[i] > ranges->upper[i]) {
        sim_view_face(solid, (size_t)ranges->face[i], lines, i, min_slope, &parts[0].face);
        set_whole(&parts[0]);
        return 1;
    }
    const size_t count = find_candidates(solid, lines, i, min_slope, ranges->upper[i], candidates);
    for (size_t face = 0; face < count; face++) {
        struct polygon polygon = {4, {{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}};
        clip_outside(&polygon, &candidates[face]);
        for (size_t other = 0; other < count && polygon.count; other++) {
            if (other != face) {
                clip_deeper(&polygon, &candidates[face], &candidates[other], face < other);
            }
        }
        parts[stored].face = candidates[face];
        stored += polygon.count > 2 && measure(&polygon, &parts[stored]);
    }
    return stored;
}
