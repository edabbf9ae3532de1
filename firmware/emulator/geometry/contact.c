#include "emulator/geometry/contact.h"

#include <math.h>
#include <string.h>

#include "emulator/physics/layer.h"

#define DEEPEST_M 0.006 /* a line that enters deeper below the electrode hits the opposite side of the object */

/* Add the force of one compressed cell to the wrench on the board, and its contribution to the stiffness k l l^T. l =
 * (n, r x n) is the line of action through the cell at r; `compression` is in metres. */
static void add_cell(struct contact_load *load, const struct cell *cell, double compression)
{
    const double *n = cell->normal, *r = cell->position;
    const double line[6] = {
        n[0], n[1], n[2], r[1] * n[2] - r[2] * n[1], r[2] * n[0] - r[0] * n[2], r[0] * n[1] - r[1] * n[0]};
    const double force = layer_contact_pressure(compression) * cell->area;
    const double rate = layer_contact_stiffness(compression) * cell->area;
    for (int i = 0; i < 6; i++) {
        load->wrench[i] -= force * line[i];
        for (int j = 0; j < 6; j++) {
            load->stiffness[i][j] += rate * line[i] * line[j];
        }
    }
}

/* Whether the bounding spheres of board and object are farther apart than `reach` (metres). False does not imply a
 * contact. */
bool contact_is_far(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                    double reach)
{
    double centre[3], square = 0.0;
    frame_point(object_from_bracket, patch->centre, centre);
    for (int k = 0; k < 3; k++) {
        square += (centre[k] - shape->centre[k]) * (centre[k] - shape->centre[k]);
    }
    const double limit = patch->bound + shape->bound + reach;
    return square > limit * limit;
}

/* Whether every cell of a square of skin is farther from the object than `reach` (metres), by a test of one cell. This
 * holds for most squares of a hand most of the time. size: bound of the distance between cells of a square, metres. */
static bool square_is_far(const struct cell *cells, double size, const struct shape *shape,
                          const struct frame *object_from_bracket, double reach)
{
    double point[3];
    frame_point(object_from_bracket, cells[0].position, point);
    return shape_distance_bound(shape, point) >= reach + size;
}

/* Transform the cells of a square to the object's frame, as lines along their normals. size: as for square_is_far(). */
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

/* Add the load (wrench and stiffness) of the bare sheet beside the taxels. Returns whether that sheet touches the
 * object. */
static bool press_margins(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                          double thickness, struct contact_load *load)
{
    bool is_touching = false;
    for (size_t square = 0; square < patch->margin_count; square++) {
        const struct cell *cells = &patch->margins[square * CELLS_PER_TAXEL];
        struct shape_lines lines;
        if (square_is_far(cells, patch->reach, shape, object_from_bracket, thickness)) {
            continue;
        }
        place_lines(&lines, cells, patch->reach, object_from_bracket);
        shape_entries(shape, &lines, fmax(thickness, DEEPEST_M));
        for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
            if (lines.entry[i] >= -DEEPEST_M && lines.entry[i] < thickness) {
                is_touching = true;
                add_cell(load, &cells[i], thickness - lines.entry[i]);
            }
        }
    }
    return is_touching;
}

/* Compress every cell to the depth at which the object enters the layer along the normal of the cell. Writes the
 * compression and the gap (metres) of each cell and the wrench and stiffness of the board; returns whether the object
 * touches the board. Each cell is an independent spring. */
bool contact_solve(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                   double thickness, double reach, double *compression, double *gap, struct contact_load *load)
{
    bool is_touching = false;
    if (load) {
        memset(load, 0, sizeof *load);
    }
    memset(compression, 0, patch->cell_count * sizeof *compression);
    for (size_t i = 0; gap && i < patch->cell_count; i++) {
        gap[i] = CONTACT_FAR_M;
    }
    if (contact_is_far(patch, shape, object_from_bracket, thickness + reach)) {
        return false;
    }
    for (size_t taxel = 0; taxel < patch->taxel_count; taxel++) {
        const size_t first = taxel * CELLS_PER_TAXEL;
        if (square_is_far(&patch->cells[first], patch->reach, shape, object_from_bracket, thickness + reach)) {
            continue;
        }
        struct shape_lines lines;
        place_lines(&lines, &patch->cells[first], patch->reach, object_from_bracket);
        shape_entries(shape, &lines, fmax(thickness + reach, DEEPEST_M));
        for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
            const double entry = lines.entry[i];
            if (entry < -DEEPEST_M || entry > thickness + reach) {
                continue;
            }
            if (gap) {
                gap[first + i] = entry >= thickness ? entry - thickness : 0.0;
            }
            if (entry >= thickness) {
                continue;
            }
            is_touching = true;
            compression[first + i] = thickness - entry;
            if (load) {
                add_cell(load, &patch->cells[first + i], compression[first + i]);
            }
        }
    }
    if (load && press_margins(patch, shape, object_from_bracket, thickness, load)) {
        is_touching = true;
    }
    return is_touching;
}
