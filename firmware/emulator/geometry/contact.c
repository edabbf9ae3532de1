#include "emulator/geometry/contact.h"

#include <math.h>
#include <string.h>

#include "emulator/geometry/contact_load.h"
#include "emulator/geometry/cover_whole.h"
#include "emulator/physics/layer.h"

#define ROUNDING_M 1e-9 /* metres; larger than the rounding errors of distances */
#define DEEPEST_M 0.006 /* a surface deeper below the electrode does not limit the compression */

/* Return a lower bound (metres) of the distance between the electrodes of a board and the object, from the bounding
 * sphere of the board and the bounding sphere and surfaces of the object. */
static double bound_distance(const struct patch *patch, const struct shape *shape,
                             const struct frame *object_from_bracket)
{
    double centre[3], square = 0.0;
    frame_point(object_from_bracket, patch->centre, centre);
    for (int k = 0; k < 3; k++) {
        square += (centre[k] - shape->centre[k]) * (centre[k] - shape->centre[k]);
    }
    return fmax(sqrt(square) - shape->bound, shape_distance_bound(shape, centre)) - patch->bound;
}

/* Return whether board and object are certainly farther apart than `reach` (metres). False does not imply a contact. */
bool contact_is_far(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                    double reach)
{
    return bound_distance(patch, shape, object_from_bracket) > reach;
}

/* Compute the middle of a square of skin (the 4 x 4 cells of a taxel) in the object's frame: the point halfway between
 * two opposite corner cells. */
static void find_middle(const struct cell *cells, const struct frame *object_from_bracket, double middle[3])
{
    double point[3];
    for (int k = 0; k < 3; k++) {
        point[k] = 0.5 * (cells[0].position[k] + cells[CELLS_PER_TAXEL - 1].position[k]);
    }
    frame_point(object_from_bracket, point, middle);
}

/* Return a lower bound (metres) of the distance from the electrodes of a square of skin to the object, from the
 * distance of the middle of the square. Negative if the middle lies deep in the object. size: upper bound of the
 * distance between two points of the square, metres. */
static double bound_square_distance(const struct cell *cells, double size, const struct shape *shape,
                                    const struct frame *object_from_bracket)
{
    double middle[3];
    find_middle(cells, object_from_bracket, middle);
    return shape_distance_bound(shape, middle) - 0.5 * size;
}

/* Return whether every cell of square number `square` (the 16 cells of a taxel) has an electrode at least `thickness` +
 * `reach` (metres) away from the object, which holds for most squares of a hand most of the time. With a grip, the
 * distance is not computed in each call: grip->travel is the motion of the board so far, and grip->due[square] is the
 * travel at which the square may first touch the object. While the travel is below this value, the difference of both
 * is a lower bound of the distance. Updates grip->due and load->clearance; grip and load may be NULL. */
static bool square_is_far(const struct cell *cells, size_t square, const struct patch *patch, const struct shape *shape,
                          const struct frame *object_from_bracket, double thickness, double reach,
                          struct contact_grip *grip, struct contact_load *load)
{
    double distance = 0.0;
    if (grip && grip->due[square] > grip->travel) {
        distance = grip->due[square] - grip->travel;
    } else {
        distance = bound_square_distance(cells, patch->reach, shape, object_from_bracket) - thickness;
        if (grip) {
            grip->due[square] = grip->travel + distance;
        }
    }
    if (load) {
        load->clearance = fmin(load->clearance, fmax(distance, 0.0));
    }
    return distance >= reach;
}

/* Add an upper bound of the motion of the board relative to the object since the last call to both travel counters of
 * the grip. The bound is the shift of the bracket's origin, plus the norm of the change of the rotation matrix times
 * the largest distance of a cell from that origin. skin_travel is the bound for the outer surface of the layer, which
 * lies `thickness` (metres) farther away. The first call sets travel counters and stored distances to 0. */
static void add_travel(struct contact_grip *grip, const struct patch *patch, const struct frame *object_from_bracket,
                       double thickness)
{
    double shift = 0.0, turn = 0.0;
    const double *c = patch->centre, size = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + patch->bound;
    for (int i = 0; grip->has_frame && i < 12; i++) {
        const double change = object_from_bracket->row[i / 4][i % 4] - grip->frame.row[i / 4][i % 4];
        *(i % 4 == 3 ? &shift : &turn) += change * change; /* column 3 is the translation */
    }
    if (!grip->has_frame) {
        memset(grip->due, 0, (patch->taxel_count + patch->margin_count) * sizeof *grip->due);
        grip->travel = grip->skin_travel = 0.0;
        if (grip->untouched) {
            memset(grip->untouched, 0, (patch->taxel_count + patch->margin_count) * sizeof *grip->untouched);
        }
    }
    grip->has_frame = true;
    grip->frame = *object_from_bracket;
    grip->travel += sqrt(shift) + sqrt(turn) * size;
    grip->skin_travel += sqrt(shift) + sqrt(turn) * (size + thickness);
}

/* Transform the 16 cells of a square of skin to the object's frame, as lines from the electrode surface along the
 * normals of the cells. size: upper bound of the distance between two points of the square, metres. */
static void place_lines(struct shape_lines *lines, const struct cell *cells, double size,
                        const struct frame *object_from_bracket)
{
    frame_point(object_from_bracket, cells[0].position, lines->middle);
    lines->radius = size;
    for (int k = 0; k < 3; k++) {
        const double *row = object_from_bracket->row[k];
        for (int i = 0; i < CELLS_PER_TAXEL; i++) {
            const double *p = cells[i].position, *n = cells[i].normal;
            lines->origin[k][i] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
            lines->direction[k][i] = row[0] * n[0] + row[1] * n[1] + row[2] * n[2];
        }
    }
}

/* Transform the 16 cells of a square of skin to the object's frame: normal, half sides and top of each cell. The top
 * lies on the surface of the unloaded layer, `thickness` metres above the electrode. */
static void place_square(struct cover_square *square, const struct cell *cells, double thickness,
                         const struct frame *object_from_bracket)
{
    for (int k = 0; k < 3; k++) {
        const double *row = object_from_bracket->row[k];
        for (int i = 0; i < CELLS_PER_TAXEL; i++) {
            const double *p = cells[i].position, *n = cells[i].normal;
            const double *a = cells[i].half[0], *b = cells[i].half[1];
            square->normal[k][i] = row[0] * n[0] + row[1] * n[1] + row[2] * n[2];
            square->top[k][i] =
                row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3] + thickness * square->normal[k][i];
            square->half[0][k][i] = row[0] * a[0] + row[1] * a[1] + row[2] * a[2];
            square->half[1][k][i] = row[0] * b[0] + row[1] * b[1] + row[2] * b[2];
        }
    }
}

/* Return the mean pressure (Pa) on a cell in the direction of its normal: the sum over the `count` faces of the object
 * that load the cell. slope: cosine of the angle between cell and face. steep: this cosine, at least COVER_STEEPEST.
 * The factor slope / steep is therefore 1 for inclinations up to 60 degrees, and smaller for a steeper face. */
static double compute_normal_pressure(const struct cover_load *faces, size_t count)
{
    double pressure = 0.0;
    for (size_t i = 0; i < count; i++) {
        pressure += fmax(faces[i].face.slope, 0.0) / faces[i].face.steep * faces[i].pressure;
    }
    return pressure;
}

/* Mark the 16 cells of a square, which begin at cell number `first`, as no longer stuck to the object. Does nothing
 * without a grip, or if the grip must not change. */
static void release_square(const struct contact_grip *grip, size_t first)
{
    if (grip && grip->advances) {
        memset(&grip->stuck[first], 0, CELLS_PER_TAXEL * sizeof *grip->stuck);
    }
}

/* Store that no cell of a square touches the object before the board has moved by `distance` (metres), the distance of
 * the square from the object. first: number of the first cell of the square. Does nothing if the grip stores no
 * distances. */
static void store_distance(struct contact_grip *grip, size_t first, double distance)
{
    if (grip && grip->untouched) {
        grip->untouched[first / CELLS_PER_TAXEL] = grip->skin_travel + distance - ROUNDING_M;
    }
}

/* Return whether no cell of square number `square` can touch the object, because the board has moved less since the
 * last examination of the square than the distance found then. */
static bool is_still_untouched(const struct contact_grip *grip, size_t square)
{
    return grip && grip->untouched && grip->skin_travel < grip->untouched[square];
}

/* Inputs and results of the contact of one board, the same for all its squares. */
struct solution {
    const struct patch *patch;
    const struct shape *shape;
    const struct frame *object_from_bracket;
    double thickness;
    struct contact_grip *grip; /* NULL: cells are not sheared */
    struct contact_load *load; /* NULL: not computed */
    struct load_sums sums;     /* loads of the cells that lie wholly below one face; used if there is a grip */
};

/* Compute the contact of cell number `cell` of a square with the faces of the object, and add its load to the load of
 * the board. Writes compression[cell] in metres (array may be NULL) if the cell touches. Returns whether the cell
 * touches the object. */
static bool press_cell(struct solution *solution, const struct load_square *square, const struct cover_planes *planes,
                       size_t cell, double *compression)
{
    const struct contact_grip *grip = solution->grip;
    const struct cover_cell place = contact_load_get_cell(square->places, cell);
    struct cover_load faces[COVER_FACES_MAX];
    const size_t count = cover_press(solution->shape, planes, &place, faces);
    if (!count) {
        return false;
    }
    if (compression) {
        compression[cell] = layer_contact_compression(compute_normal_pressure(faces, count));
    }
    if (solution->load) {
        contact_load_add_cell(solution->load, square, cell, faces, count, solution->thickness, grip);
    }
    return true;
}

/* Solve the contact of the 16 cells of a square, whose first cell has the number `first`, and add their loads to the
 * board. With shear, the cells that lie wholly below one face of the object (`whole`) are computed together, which is
 * faster; press_cell() computes the other ones. Writes the compression (metres, may be NULL) in the direction of the
 * normal for each cell that touches the object; other entries keep their value. Releases the cells that do not touch
 * from the grip. Returns whether a cell touches. */
static bool press_square(struct solution *solution, const struct cell *cells, size_t first, double *compression)
{
    const double size = solution->patch->reach, thickness = solution->thickness;
    struct contact_grip *grip = solution->grip;
    const bool has_shear = solution->load && grip;
    struct cover_planes planes;
    struct cover_square places;
    struct cover_whole whole;
    double middle[3];
    bool is_touching = false, touched[CELLS_PER_TAXEL];
    const struct load_square square = {cells, first, &places, solution->object_from_bracket};
    find_middle(cells, solution->object_from_bracket, middle);
    cover_find_planes(solution->shape, middle, 0.5 * size + thickness, DEEPEST_M, &planes);
    place_square(&places, cells, thickness, solution->object_from_bracket);
    const double distance = cover_find_touched(solution->shape, &planes, &places, touched);
    if (distance > 0.0) {
        store_distance(grip, first, distance);
        release_square(grip, first);
        return false;
    }
    if (has_shear) {
        cover_press_whole(solution->shape, &planes, &places, touched, &whole);
        is_touching = whole.has_any;
        if (whole.has_any) {
            contact_load_add_whole(&solution->sums, &square, &whole, grip);
        }
    }
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        if (has_shear && whole.is_whole[i]) {
            if (compression) {
                const double share = fmax(whole.slope[i], 0.0) / whole.steep[i];
                compression[i] = layer_contact_compression(share * whole.pressure[i]);
            }
            continue;
        }
        if (touched[i] && press_cell(solution, &square, &planes, i, compression)) {
            is_touching = true;
        } else if (grip && grip->advances) {
            grip->stuck[first + i] = 0.0;
        }
    }
    return is_touching;
}

/* Write the gap (metres) from the surface of the layer to the object along the normal for each of the 16 cells of a
 * square of skin, 0 inside the object. Gaps that exceed `reach`, or that do not exist because the normal misses the
 * object, keep their previous value. */
static void write_gaps(const struct cell *cells, const struct shape *shape, double size,
                       const struct frame *object_from_bracket, double thickness, double reach, double *gap)
{
    struct shape_lines lines;
    place_lines(&lines, cells, size, object_from_bracket);
    shape_entries(shape, &lines, fmax(thickness + reach, DEEPEST_M));
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        if (lines.entry[i] >= -DEEPEST_M && lines.entry[i] <= thickness + reach) {
            gap[i] = fmax(lines.entry[i] - thickness, 0.0);
        }
    }
}

/* Solve the contact of the margins (bare sheet beside the taxels) and add their load to the board. Returns whether a
 * margin touches the object. */
static bool press_margins(struct solution *solution)
{
    const struct patch *patch = solution->patch;
    bool is_touching = false;
    for (size_t square = 0; square < patch->margin_count; square++) {
        const struct cell *cells = &patch->margins[square * CELLS_PER_TAXEL];
        const size_t number = patch->taxel_count + square, first = number * CELLS_PER_TAXEL;
        if (square_is_far(cells, number, patch, solution->shape, solution->object_from_bracket, solution->thickness,
                          0.0, solution->grip, solution->load) ||
            is_still_untouched(solution->grip, number)) {
            release_square(solution->grip, first);
            continue;
        }
        is_touching |= press_square(solution, cells, first, NULL);
    }
    return is_touching;
}

/* Set the results to their values without contact: load 0 with infinite clearance, compression 0, gaps CONTACT_FAR_M.
 * Each result may be NULL. */
static void clear_results(const struct patch *patch, double *compression, double *gap, struct contact_load *load)
{
    if (load) {
        memset(load, 0, sizeof *load);
        load->clearance = INFINITY;
    }
    if (compression) {
        memset(compression, 0, patch->cell_count * sizeof *compression);
    }
    for (size_t i = 0; gap && i < patch->cell_count; i++) {
        gap[i] = CONTACT_FAR_M;
    }
}

/* Solve the contact of all squares of a board. compression, gap: arrays over the cells as for contact_solve(). Margins
 * are included only if a load is requested. Returns whether a cell touches. */
static bool press_board(struct solution *solution, double reach, double *compression, double *gap)
{
    const struct patch *patch = solution->patch;
    bool is_touching = false;
    for (size_t taxel = 0; taxel < patch->taxel_count; taxel++) {
        const size_t first = taxel * CELLS_PER_TAXEL;
        const struct cell *cells = &patch->cells[first];
        if (square_is_far(cells, taxel, patch, solution->shape, solution->object_from_bracket, solution->thickness,
                          reach, solution->grip, solution->load) ||
            (!gap && is_still_untouched(solution->grip, taxel))) {
            release_square(solution->grip, first);
            continue;
        }
        if (gap) {
            write_gaps(cells, solution->shape, patch->reach, solution->object_from_bracket, solution->thickness, reach,
                       &gap[first]);
        }
        is_touching |= press_square(solution, cells, first, compression ? &compression[first] : NULL);
    }
    return (solution->load && press_margins(solution)) || is_touching;
}

/* Solve the contact of a board's skin with an object; contact.h describes arguments and results. Each cell (a sixteenth
 * of a taxel) is an independent spring: the pressure on a cell does not depend on its neighbours. */
bool contact_solve(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                   double thickness, double reach, double *compression, double *gap, struct contact_load *load,
                   struct contact_grip *grip)
{
    clear_results(patch, compression, gap, load);
    if (grip) {
        add_travel(grip, patch, object_from_bracket, thickness);
    }
    if (contact_is_far(patch, shape, object_from_bracket, thickness + reach)) {
        if (load) {
            load->clearance = bound_distance(patch, shape, object_from_bracket) - thickness;
        }
        for (size_t square = 0; square < patch->taxel_count + patch->margin_count; square++) {
            release_square(grip, square * CELLS_PER_TAXEL);
        }
        return false;
    }
    struct solution solution = {.patch = patch,
                                .shape = shape,
                                .object_from_bracket = object_from_bracket,
                                .thickness = thickness,
                                .grip = grip,
                                .load = load};
    const bool is_touching = press_board(&solution, reach, compression, gap);
    if (load && is_touching) {
        contact_load_join(load, &solution.sums);
        contact_load_turn(object_from_bracket, load);
    }
    return is_touching;
}
