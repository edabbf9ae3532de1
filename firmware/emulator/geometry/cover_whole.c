#include "emulator/geometry/cover_whole.h"

#include <math.h>

#include "emulator/physics/layer.h"

/* State of the search for the least deep face over each cell of a square. The depth of this face varies over the cell
 * between `high` (smallest depth) and `low` (largest depth), in metres below the top of the cell. */
struct search {
    double low[SHAPE_LINES], high[SHAPE_LINES];
    double other_high[SHAPE_LINES]; /* smallest depth of all other faces anywhere in the cell */
};

/* One face of the object over the 16 cells of a square: outward normal, and distance of the top of each cell from its
 * plane (metres, positive inside the object). For a curved wall, each cell has its own tangent plane. */
struct square_face {
    double normal[3][SHAPE_LINES], level[SHAPE_LINES];
    /* metres to add to the depth: the distance below the top of the cell at which the plane touches a curved wall */
    double depth_offset[SHAPE_LINES];
};

/* Compare a face of the object with the least deep face found so far, for each of the 16 cells of a square of skin.
 * Depth: distance (metres) from the top of the cell down to the face. Over the cell the depth varies from `high` =
 * depth - extent (smallest depth) to `low` = depth + extent (largest depth). The face with the smaller `low` is the
 * less deep face, and is stored in `search` and `whole`. search->other_high becomes the smallest `high` of all other
 * faces. The loop has no branches, so that the compiler vectorises it. */
static void compare_face(const struct square_face *face, const struct cover_square *square, struct search *search,
                         struct cover_whole *whole)
{
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double n[3] = {face->normal[0][i], face->normal[1][i], face->normal[2][i]};
        const double slope = -(n[0] * square->normal[0][i] + n[1] * square->normal[1][i] + n[2] * square->normal[2][i]);
        const double along = n[0] * square->half[0][0][i] + n[1] * square->half[0][1][i] + n[2] * square->half[0][2][i];
        const double across =
            n[0] * square->half[1][0][i] + n[1] * square->half[1][1][i] + n[2] * square->half[1][2][i];
        const double steep = slope > COVER_STEEPEST ? slope : COVER_STEEPEST, inverse = 1.0 / steep;
        const double depth = face->level[i] * inverse + face->depth_offset[i];
        const double extent = fabs(along * inverse) + fabs(across * inverse);
        const double low = depth + extent, high = depth - extent;
        const bool is_least = low < search->low[i];
        const double other = is_least ? search->high[i] : high;
        search->other_high[i] = other < search->other_high[i] ? other : search->other_high[i];
        search->low[i] = is_least ? low : search->low[i];
        search->high[i] = is_least ? high : search->high[i];
        whole->normal[0][i] = is_least ? n[0] : whole->normal[0][i];
        whole->normal[1][i] = is_least ? n[1] : whole->normal[1][i];
        whole->normal[2][i] = is_least ? n[2] : whole->normal[2][i];
        whole->slope[i] = is_least ? slope : whole->slope[i];
        whole->steep[i] = is_least ? steep : whole->steep[i];
        whole->depth[i] = is_least ? depth : whole->depth[i];
        whole->change[0][i] = is_least ? -along * inverse : whole->change[0][i];
        whole->change[1][i] = is_least ? -across * inverse : whole->change[1][i];
    }
}

/* Set a face to a plane of a polyhedron or to a cap of a cylinder. plane: outward normal and distance from the
 * origin. */
static void set_plane(struct square_face *face, const double plane[4], const struct cover_square *square)
{
    for (int i = 0; i < SHAPE_LINES; i++) {
        face->normal[0][i] = plane[0];
        face->normal[1][i] = plane[1];
        face->normal[2][i] = plane[2];
        face->level[i] =
            plane[3] - (plane[0] * square->top[0][i] + plane[1] * square->top[1][i] + plane[2] * square->top[2][i]);
        face->depth_offset[i] = 0.0;
    }
}

/* Set a face to the tangent planes of a cylinder's wall, one for each cell of a square: at the point where the line
 * from the top of the cell against its normal meets the wall, found by Newton's method. As soon as the wall is steeper
 * than COVER_STEEPEST in a step, the tangent plane of this step is kept, because the exact intersection no longer
 * matters. */
static void set_wall(struct square_face *face, const struct shape *shape, const struct cover_square *square)
{
    double depth[SHAPE_LINES] = {0.0};
    /* 1: the plane is kept in the next steps; a double, for vectorised loops */
    double has_fixed_plane[SHAPE_LINES] = {0.0};
    for (int step = 0; step <= COVER_WALL_STEPS; step++) {
        for (int i = 0; i < SHAPE_LINES; i++) {
            const double x = square->top[0][i] - depth[i] * square->normal[0][i];
            const double y = square->top[1][i] - depth[i] * square->normal[1][i];
            const double radius = sqrt(x * x + y * y), positive = radius > 0.0 ? radius : 1.0;
            const double n[2] = {radius > 0.0 ? x / positive : 1.0, radius > 0.0 ? y / positive : 0.0};
            const double slope = -(n[0] * square->normal[0][i] + n[1] * square->normal[1][i]);
            const double steep = slope > COVER_STEEPEST ? slope : COVER_STEEPEST;
            const bool is_kept = has_fixed_plane[i] > 0.0;
            face->normal[0][i] = is_kept ? face->normal[0][i] : n[0];
            face->normal[1][i] = is_kept ? face->normal[1][i] : n[1];
            face->normal[2][i] = 0.0;
            face->level[i] = is_kept ? face->level[i] : shape->radius - radius;
            face->depth_offset[i] = is_kept ? face->depth_offset[i] : depth[i];
            has_fixed_plane[i] = slope < COVER_STEEPEST ? 1.0 : has_fixed_plane[i];
            const double next = (shape->radius - radius) / steep + depth[i];
            depth[i] = next > 0.0 ? next : 0.0;
        }
    }
}

/* Find the face of the object with the smallest depth over each of the 16 cells (SHAPE_LINES) of a square of skin: this
 * face loads the cell. Depth: distance (metres) from the top of the cell down to the face. whole: result; normal, slope
 * and depth of this face are written for each cell, and the load is left to the caller. search: largest (`low`) and
 * smallest depth (`high`) of this face over each cell, and smallest depth of all other faces (`other_high`); INFINITY
 * before the first face is compared. planes: indices of the planes of a polyhedron that are compared; unused for a
 * cylinder. */
static void find_least(const struct shape *shape, const struct cover_planes *planes, const struct cover_square *square,
                       struct search *search, struct cover_whole *whole)
{
    struct square_face face;
    for (int i = 0; i < SHAPE_LINES; i++) {
        search->low[i] = search->high[i] = search->other_high[i] = INFINITY;
    }
    if (shape->kind == SHAPE_CYLINDER) {
        const double caps[2][4] = {{0.0, 0.0, -1.0, 0.0}, {0.0, 0.0, 1.0, shape->height}};
        set_wall(&face, shape, square);
        compare_face(&face, square, search, whole);
        for (int cap = 0; cap < 2; cap++) {
            set_plane(&face, caps[cap], square);
            compare_face(&face, square, search, whole);
        }
        return;
    }
    for (size_t plane = 0; plane < planes->count; plane++) {
        set_plane(&face, shape->planes[planes->index[plane]], square);
        compare_face(&face, square, search, whole);
    }
}

/* Find the cells that lie wholly below one face and compute their loads; cover_whole.h describes the arguments. The
 * pressure is integrated by Gauss's rule of order 2 in the direction in which the depth changes most. */
void cover_press_whole(const struct shape *shape, const struct cover_planes *planes, const struct cover_square *square,
                       const bool touched[SHAPE_LINES], struct cover_whole *whole)
{
    struct search search;
    double scale[SHAPE_LINES], depth[2][SHAPE_LINES], pressure[2][SHAPE_LINES], rate[2][SHAPE_LINES];
    find_least(shape, planes, square, &search, whole);
    whole->has_any = false;
    for (int i = 0; i < SHAPE_LINES; i++) {
        /* the face is below the whole top of the cell, and every other face is deeper everywhere */
        whole->is_whole[i] = touched[i] && search.high[i] > 0.0 && search.other_high[i] > search.low[i];
        whole->has_any |= whole->is_whole[i];
    }
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double *a = whole->change[0], *b = whole->change[1];
        const double steepest = sqrt(a[i] * a[i] + b[i] * b[i]), step = COVER_GAUSS_TWO * steepest;
        scale[i] = steepest > 0.0 ? COVER_GAUSS_TWO / steepest : 0.0;
        depth[0][i] = whole->is_whole[i] ? whole->depth[i] - step : 0.0;
        depth[1][i] = whole->is_whole[i] ? whole->depth[i] + step : 0.0;
    }
    for (int side = 0; whole->has_any && side < 2; side++) {
        layer_contact_curves(depth[side], SHAPE_LINES, pressure[side], rate[side]);
    }
    for (int i = 0; whole->has_any && i < SHAPE_LINES; i++) {
        const double sum = pressure[0][i] + pressure[1][i], difference = pressure[1][i] - pressure[0][i];
        const double place = difference / (sum > 0.0 ? sum : 1.0) * scale[i];
        whole->pressure[i] = 0.5 * sum;
        whole->rate[i] = 0.5 * (rate[0][i] + rate[1][i]);
        whole->centre[0][i] = place * whole->change[0][i];
        whole->centre[1][i] = place * whole->change[1][i];
    }
}
