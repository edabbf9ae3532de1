#include "emulator/geometry/cover.h"

#include <math.h>

#include "emulator/geometry/vector.h"
#include "emulator/physics/layer.h"

/* parallel lines across a cell, at the points of Gauss's rule of order 3, along which the pressure is integrated */
#define STRIPS 3

static const double strip_place[STRIPS] = {-0.77459666924148338, 0.0, 0.77459666924148338};
static const double strip_weight[STRIPS] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

static double lesser(double a, double b)
{
    return a < b ? a : b;
}

static double greater(double a, double b)
{
    return a > b ? a : b;
}

/* Compute from the normal of a face of the object its other values over a cell: slope (cosine of the angle between cell
 * and face), depth of the face below the middle of the cell's top, and change of the depth along both half sides
 * (metres). level: distance (metres) of the middle of the cell's top from the plane of the face, positive inside the
 * object. */
static void set_face(struct cover_face *face, const struct cover_cell *cell, double level)
{
    face->slope = -dot(face->normal, cell->normal);
    face->steep = face->slope > COVER_STEEPEST ? face->slope : COVER_STEEPEST;
    const double inverse = 1.0 / face->steep;
    face->depth = level * inverse;
    face->change[0] = -dot(face->normal, cell->half[0]) * inverse;
    face->change[1] = -dot(face->normal, cell->half[1]) * inverse;
}

/* Set the face to the tangent plane of a cylinder's wall at the point where the line from the middle of the cell's top,
 * against the normal of the cell, meets the wall. Newton's method finds this point. */
static void set_wall(struct cover_face *face, const struct shape *shape, const struct cover_cell *cell)
{
    double depth = 0.0;
    for (int step = 0; step <= COVER_WALL_STEPS; step++) {
        const double x = cell->top[0] - depth * cell->normal[0], y = cell->top[1] - depth * cell->normal[1];
        const double radius = sqrt(x * x + y * y);
        face->normal[0] = radius > 0.0 ? x / radius : 1.0;
        face->normal[1] = radius > 0.0 ? y / radius : 0.0;
        face->normal[2] = 0.0;
        set_face(face, cell, shape->radius - radius);
        face->depth += depth;
        if (face->slope < COVER_STEEPEST) {
            return; /* the wall is too steep for its intersection with the line to matter */
        }
        depth = face->depth > 0.0 ? face->depth : 0.0;
    }
}

/* Set the face to one of the three faces of a cylinder over a cell. number: 0 wall, 1 lower cap, 2 upper cap. */
static void set_cylinder_face(struct cover_face *face, const struct shape *shape, const struct cover_cell *cell,
                              size_t number)
{
    if (number == 0) {
        set_wall(face, shape, cell);
        return;
    }
    face->normal[0] = face->normal[1] = 0.0;
    face->normal[2] = number == 1 ? -1.0 : 1.0;
    set_face(face, cell, number == 1 ? cell->top[2] : shape->height - cell->top[2]);
}

/* Return the largest change (metres) of the depth of a face between the middle of a cell and its border. */
static double compute_depth_variation(const struct cover_face *face)
{
    return fabs(face->change[0]) + fabs(face->change[1]);
}

/* Find the faces of the object that determine the compression of a cell: at each point of the cell, the face with the
 * smallest depth does. A face is kept if its smallest depth over the cell does not exceed `least`, the smallest of the
 * faces' largest depths. Returns the number of faces; 0 if the whole cell lies outside one of the faces, so that the
 * object does not touch the cell. */
static size_t find_faces(const struct shape *shape, const struct cover_planes *planes, const struct cover_cell *cell,
                         struct cover_face faces[COVER_FACES_MAX])
{
    const bool is_cylinder = shape->kind == SHAPE_CYLINDER;
    const size_t total = is_cylinder ? 3 : planes->count;
    double least = INFINITY;
    size_t count = 0, kept = 0;
    for (size_t i = 0; i < total; i++) {
        struct cover_face *face = &faces[count];
        if (is_cylinder) {
            set_cylinder_face(face, shape, cell, i);
        } else {
            const double *plane = shape->planes[planes->index[i]];
            face->normal[0] = plane[0];
            face->normal[1] = plane[1];
            face->normal[2] = plane[2];
            set_face(face, cell, plane[3] - dot(plane, cell->top));
        }
        const double extent = compute_depth_variation(face);
        if (face->depth + extent <= 0.0) {
            return 0;
        }
        least = face->depth + extent < least ? face->depth + extent : least;
        count += face->depth - extent <= least && count < COVER_FACES_MAX - 1;
    }
    for (size_t i = 0; i < count; i++) {
        if (faces[i].depth - compute_depth_variation(&faces[i]) <= least) {
            faces[kept] = kept < i ? faces[i] : faces[kept];
            kept++;
        }
    }
    return kept;
}

/* Choose the direction of the strips along which the pressure over a cell is integrated: 0 or 1, the side of the cell
 * along which the depths of the faces change most differently. The strips then cross the edges between the faces. */
static int choose_direction(const struct cover_face *faces, size_t count)
{
    double range[2];
    for (int side = 0; side < 2; side++) {
        double low = 0.0, high = 0.0; /* 0: the surface of the layer counts as a face of constant depth, because the
                                       * contact ends where a face meets it */
        for (size_t i = 0; i < count; i++) {
            low = lesser(low, faces[i].change[side]);
            high = greater(high, faces[i].change[side]);
        }
        range[side] = high - low;
    }
    return range[1] > range[0];
}

/* Add the pressure of a face on a part of a strip to the load of the face, by Gauss's rule of order 2. The strip
 * crosses the cell in direction `direction` (0 or 1); `from`, `to` (along the strip) and `place` (across it) are in
 * half sides. weight: of the strip in the sum over the strips of the cell. */
static void add_piece(struct cover_load *load, int direction, double from, double to, double place, double weight)
{
    const struct cover_face *face = &load->face;
    const double middle = 0.5 * (from + to), half = 0.5 * (to - from), share = weight * half;
    load->share += share;
    for (int side = -1; side <= 1; side += 2) {
        const double at = middle + side * COVER_GAUSS_TWO * half;
        double rate;
        const double depth = face->depth + face->change[direction] * at + face->change[!direction] * place;
        const double pressure = layer_contact_curve(depth, &rate);
        load->pressure += 0.5 * share * pressure;
        load->rate += 0.5 * share * rate;
        load->centre[direction] += 0.5 * share * pressure * at;
        load->centre[!direction] += 0.5 * share * pressure * place;
    }
}

/* Integrate the pressure along a strip across a cell, and add it to the loads. The strip extends from -1 to 1 (half
 * sides of the cell). At each point, the face with the smallest depth presses. The loop therefore splits the strip at
 * the edges where another face becomes the least deep. loads: one per face, `count` in total. direction, place, weight:
 * as for add_piece(). */
static void press_strip(struct cover_load *loads, size_t count, int direction, double place, double weight)
{
    double depth[COVER_FACES_MAX], at = -1.0;
    size_t least = 0;
    for (size_t i = 0; i < count; i++) {
        const double *change = loads[i].face.change;
        depth[i] = loads[i].face.depth - change[direction] + change[!direction] * place; /* at the start of the strip */
        if (depth[i] < depth[least] ||
            (depth[i] == depth[least] && change[direction] < loads[least].face.change[direction])) {
            least = i;
        }
    }
    while (at < 1.0) {
        const double change = loads[least].face.change[direction];
        double end = 1.0;
        size_t next = least;
        for (size_t i = 0; i < count; i++) {
            const double closing = change - loads[i].face.change[direction];
            if (closing > 0.0) {
                const double edge = (depth[i] - depth[least]) / closing - 1.0;
                if (edge < end) {
                    end = greater(edge, at);
                    next = i;
                }
            }
        }
        /* depth at the middle of the strip, position 0; the depth of the face is 0 at position -start / change */
        const double start = depth[least] + change;
        const double from = change > 0.0 ? greater(at, -start / change) : at;
        const double to = change < 0.0 ? lesser(end, -start / change) : start > 0.0 || change > 0.0 ? end : at;
        if (to > from) {
            add_piece(&loads[least], direction, from, to, place, weight);
        }
        if (next == least) {
            return;
        }
        least = next;
        at = end;
    }
}

/* Compute the load of a face on a cell that lies wholly below this face and below no other face: mean pressure, mean
 * derivative of the pressure by the depth, and centre of pressure (in half sides). Gauss's rule of order 2 needs only
 * two pressures. They are taken in the direction in which the depth changes most, at the depths whose variance equals
 * the variance of the depth over the cell. */
static void press_wholly_covered(struct cover_load *load)
{
    const double *change = load->face.change;
    const double steepest = sqrt(change[0] * change[0] + change[1] * change[1]);
    const double scale = steepest > 0.0 ? COVER_GAUSS_TWO / steepest : 0.0, step = COVER_GAUSS_TWO * steepest;
    double rate[2];
    const double above = layer_contact_curve(load->face.depth - step, &rate[0]);
    const double below = layer_contact_curve(load->face.depth + step, &rate[1]);
    load->share = 1.0;
    load->pressure = 0.5 * (above + below);
    load->rate = 0.5 * (rate[0] + rate[1]);
    load->centre[0] = (below - above) / (below + above) * scale * change[0];
    load->centre[1] = (below - above) / (below + above) * scale * change[1];
}

/* Compute the loads of several faces, or of one face that covers a cell only partly, by a sum over parallel strips of
 * the cell. Writes only loads with a pressure above 0 and returns their number. */
static size_t press_partly_covered(const struct cover_face *faces, size_t count,
                                   struct cover_load loads[COVER_FACES_MAX])
{
    const int direction = choose_direction(faces, count);
    size_t stored = 0;
    for (size_t i = 0; i < count; i++) {
        loads[i] = (struct cover_load){.face = faces[i]};
    }
    for (int strip = 0; strip < STRIPS; strip++) {
        press_strip(loads, count, direction, strip_place[strip], strip_weight[strip]);
    }
    for (size_t i = 0; i < count; i++) {
        if (loads[i].pressure > 0.0) {
            loads[stored] = loads[i];
            loads[stored].centre[0] /= loads[i].pressure;
            loads[stored++].centre[1] /= loads[i].pressure;
        }
    }
    return stored;
}

/* Collect the planes of the object that cells within `radius` (metres) of the point `middle` can touch. A plane is left
 * out if the point lies more than `radius` + `deepest` (metres) below it, inside the object. If all planes are that
 * far, all planes are collected. */
void cover_find_planes(const struct shape *shape, const double middle[3], double radius, double deepest,
                       struct cover_planes *planes)
{
    planes->count = 0;
    for (size_t i = 0; i < shape->plane_count; i++) {
        const double *plane = shape->planes[i];
        if (plane[3] - dot(plane, middle) <= radius + deepest) {
            planes->index[planes->count++] = i;
        }
    }
    for (size_t i = 0; i < shape->plane_count && !planes->count; i++) {
        planes->index[i] = i;
    }
    planes->count = planes->count ? planes->count : shape->plane_count;
}

/* Update the margins of the cells of a square with one plane of the object. The margin (metres) of a cell is the
 * smallest depth, over all planes, of that point of the cell which lies deepest below the plane. A negative margin
 * means that the object cannot touch the cell. The loop has no branches, so that the compiler vectorises it. */
static void reduce_margins(const double *n, const struct cover_square *square, double margin[SHAPE_LINES])
{
    const double (*t)[SHAPE_LINES] = square->top;
    const double (*a)[SHAPE_LINES] = square->half[0], (*b)[SHAPE_LINES] = square->half[1];
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double level = n[3] - n[0] * t[0][i] - n[1] * t[1][i] - n[2] * t[2][i];
        const double along = n[0] * a[0][i] + n[1] * a[1][i] + n[2] * a[2][i];
        const double across = n[0] * b[0][i] + n[1] * b[1][i] + n[2] * b[2][i];
        const double covered = level + fabs(along) + fabs(across);
        margin[i] = covered < margin[i] ? covered : margin[i];
    }
}

/* Update the margins of the cells (see reduce_margins()) with the tangent planes of a cylinder's wall. A cell whose
 * middle lies inside the wall may touch the wall, so its margin is unchanged. The tangent plane turns when the cell
 * moves along the wall, so the distance of the cell from the plane can decrease by more than the motion. A negative
 * margin is therefore divided by the largest possible ratio of this decrease to the motion. */
static void reduce_wall_margins(const struct shape *shape, const struct cover_square *square,
                                double margin[SHAPE_LINES])
{
    const double (*a)[SHAPE_LINES] = square->half[0], (*b)[SHAPE_LINES] = square->half[1];
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double x = square->top[0][i], y = square->top[1][i], radius = sqrt(x * x + y * y);
        const double inverse = 1.0 / (radius > 0.0 ? radius : 1.0), level = shape->radius - radius;
        const double along = (x * a[0][i] + y * a[1][i]) * inverse, across = (x * b[0][i] + y * b[1][i]) * inverse;
        const double extent = fabs(a[0][i]) + fabs(a[1][i]) + fabs(b[0][i]) + fabs(b[1][i]);
        const double covered = level < 0.0 ? level + fabs(along) + fabs(across) : INFINITY;
        const double reduced = covered < 0.0 ? covered * shape->radius / (shape->radius + extent) : covered;
        margin[i] = reduced < margin[i] ? reduced : margin[i];
    }
}

/* Write for each of the 16 cells (SHAPE_LINES) of a square of skin whether the object may touch it. A shape is a convex
 * polyhedron or a cylinder. planes: indices of those planes of a polyhedron that cells here can touch
 * (cover_find_planes()); only these planes are tested. A cylinder is tested by its wall and caps, without `planes`.
 * Returns a lower bound (metres) of the distance of the nearest cell from the object, or 0 if a cell may touch. */
double cover_find_touched(const struct shape *shape, const struct cover_planes *planes,
                          const struct cover_square *square, bool touched[SHAPE_LINES])
{
    double margin[SHAPE_LINES], greatest = -INFINITY;
    for (int i = 0; i < SHAPE_LINES; i++) {
        margin[i] = INFINITY;
    }
    for (size_t plane = 0; shape->kind == SHAPE_CONVEX && plane < planes->count; plane++) {
        reduce_margins(shape->planes[planes->index[plane]], square, margin);
    }
    if (shape->kind == SHAPE_CYLINDER) {
        const double caps[2][4] = {{0.0, 0.0, -1.0, 0.0}, {0.0, 0.0, 1.0, shape->height}};
        reduce_wall_margins(shape, square, margin);
        reduce_margins(caps[0], square, margin);
        reduce_margins(caps[1], square, margin);
    }
    for (int i = 0; i < SHAPE_LINES; i++) {
        touched[i] = margin[i] > 0.0;
        greatest = greater(greatest, margin[i]);
    }
    return greater(-greatest, 0.0); /* a negative margin is a distance from the object */
}

/* Compute the loads of the object's faces on a cell. Returns the number of loads written; 0 if the object does not
 * touch the cell. */
size_t cover_press(const struct shape *shape, const struct cover_planes *planes, const struct cover_cell *cell,
                   struct cover_load loads[COVER_FACES_MAX])
{
    struct cover_face faces[COVER_FACES_MAX];
    const size_t count = find_faces(shape, planes, cell, faces);
    if (count == 1 && faces[0].depth > compute_depth_variation(&faces[0])) {
        loads[0].face = faces[0];
        press_wholly_covered(&loads[0]);
        return 1;
    }
    return count ? press_partly_covered(faces, count, loads) : 0;
}
