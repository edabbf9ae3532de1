#include "emulator/geometry/contact.h"

#include <math.h>
#include <string.h>

#include "emulator/physics/layer.h"

#define DEEPEST_M 0.006 /* a surface deeper below the electrode does not limit the compression */
/* Smallest cosine between the normals of cell and object at which the object compresses the cell in full. An object that
 * enters a cell from the side compresses the cell by at most the distance from its side divided by this number. */
#define STEEPEST 0.5

/* Contact of one cell with the object, in the object's frame. */
struct cell_contact {
    double top[3];       /* surface of the unloaded layer */
    double normal[3];    /* of the object, outward */
    double direction[3]; /* of the cell, outward */
    double depth;        /* of the object below the top, against the direction, metres */
    double slope;        /* cosine between the inward normal of the object and the direction */
};

/* Examine whether the object indents a cell. origin, direction: line of the cell, and `entry` where the line enters the
 * object, metres. Returns false if the top of the cell is outside the object. */
static bool find_contact(const struct shape *shape, const double origin[3], const double direction[3], double entry,
                         double thickness, struct cell_contact *contact)
{
    double surface[3], beside[3];
    for (int k = 0; k < 3; k++) {
        contact->direction[k] = direction[k];
        contact->top[k] = origin[k] + thickness * direction[k];
        surface[k] = origin[k] + entry * direction[k];
    }
    const double side = shape_wall(shape, contact->top, beside) / STEEPEST;
    if (side <= 0.0) {
        return false;
    }
    contact->depth = entry >= -DEEPEST_M ? thickness - entry : INFINITY;
    if (side < contact->depth) {
        contact->depth = side;
        memcpy(contact->normal, beside, sizeof beside);
    } else {
        shape_wall(shape, surface, contact->normal);
    }
    contact->slope = 0.0;
    for (int k = 0; k < 3; k++) {
        contact->slope -= contact->normal[k] * direction[k];
    }
    return true;
}

/* Add the shear of cell number `cell`: force (newtons) of a spring to the point where the cell sticks to the object, and
 * its stiffness. `pressing`: normal force. */
static void add_grip(const struct contact_grip *grip, size_t cell, const struct cell_contact *contact, double area,
                     double pressing, double force[3], double stiffness[3][3])
{
    const double *n = contact->normal, spring = layer_shear_stiffness() * area;
    double shear[3] = {0.0, 0.0, 0.0}, square = 0.0;
    if (grip->sticks[cell]) {
        double along = 0.0;
        for (int k = 0; k < 3; k++) {
            shear[k] = contact->top[k] - grip->point[cell][k];
            along += shear[k] * n[k];
        }
        for (int k = 0; k < 3; k++) {
            shear[k] -= along * n[k];
            square += shear[k] * shear[k];
        }
    }
    const double limit = grip->coefficient * pressing, reached = spring * sqrt(square);
    const bool is_sliding = reached > limit;
    const double rate = is_sliding ? spring * limit / reached : spring;
    for (int i = 0; i < 3; i++) {
        force[i] -= rate * shear[i];
        for (int j = 0; j < 3; j++) {
            const double along = is_sliding ? shear[i] * shear[j] / square : 0.0;
            stiffness[i][j] += rate * ((i == j) - n[i] * n[j] - along);
        }
    }
    if (grip->advances) {
        grip->sticks[cell] = true;
        for (int k = 0; k < 3; k++) {
            grip->point[cell][k] = contact->top[k] - rate / spring * shear[k];
        }
    }
}

/* Rotate a vector from the object's frame to the bracket's frame. */
static void rotate_back(const struct frame *object_from_bracket, const double in[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        out[k] = object_from_bracket->row[0][k] * in[0] + object_from_bracket->row[1][k] * in[1] +
                 object_from_bracket->row[2][k] * in[2];
    }
}

/* Add force and stiffness of one cell to the load of the board: the force acts at the point r on the object's surface,
 * and the stiffness is that of a spring S at r: (I, [r]) S (I, [r])^T with the cross-product matrix [r]. */
static void add_spring(struct contact_load *load, const double r[3], const double force[3], double spring[3][3])
{
    const double motion[6][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, -r[2], r[1]}, {r[2], 0, -r[0]}, {-r[1], r[0], 0}};
    double product[6][3];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 3; j++) {
            product[i][j] = motion[i][0] * spring[0][j] + motion[i][1] * spring[1][j] + motion[i][2] * spring[2][j];
        }
        load->wrench[i] += motion[i][0] * force[0] + motion[i][1] * force[1] + motion[i][2] * force[2];
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            load->stiffness[i][j] +=
                product[i][0] * motion[j][0] + product[i][1] * motion[j][1] + product[i][2] * motion[j][2];
        }
    }
}

/* Add the load of one cell that carries no shear to the wrench on the board and to the stiffness: a spring along the
 * normal of the cell. */
static void add_column(struct contact_load *load, const struct cell *cell, double compression)
{
    const double *n = cell->normal;
    const double pressing = layer_contact_pressure(compression) * cell->area;
    const double rate = layer_contact_stiffness(compression) * cell->area;
    const double force[3] = {-pressing * n[0], -pressing * n[1], -pressing * n[2]};
    double spring[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            spring[i][j] = rate * n[i] * n[j];
        }
    }
    add_spring(load, cell->position, force, spring);
}

/* Add the load of cell number `number`, which sticks to the object, to the wrench on the board and to the stiffness. The
 * force has the direction of the object's normal and a part across from the shear; its part along the cell follows from
 * the compression. */
static void add_cell(struct contact_load *load, const struct cell *cell, size_t number,
                     const struct cell_contact *contact, const struct frame *object_from_bracket, double thickness,
                     const struct contact_grip *grip)
{
    const double slope = fmax(contact->slope, STEEPEST);
    const double pressing = layer_contact_pressure(contact->depth) * cell->area / slope;
    const double rate = layer_contact_stiffness(contact->depth) * cell->area / (slope * slope);
    double force[3], spring[3][3], turned[3][3], arm[3];
    for (int i = 0; i < 3; i++) {
        force[i] = pressing * contact->normal[i];
        for (int j = 0; j < 3; j++) {
            spring[i][j] = rate * contact->normal[i] * contact->normal[j];
        }
    }
    add_grip(grip, number, contact, cell->area, pressing, force, spring);
    double force_back[3], half[3][3];
    rotate_back(object_from_bracket, force, force_back);
    for (int i = 0; i < 3; i++) {
        rotate_back(object_from_bracket, spring[i], half[i]); /* rows of S R */
    }
    for (int j = 0; j < 3; j++) {
        const double column[3] = {half[0][j], half[1][j], half[2][j]};
        rotate_back(object_from_bracket, column, turned[j]); /* rows of R^T S R, which is symmetric */
    }
    for (int k = 0; k < 3; k++) {
        arm[k] = cell->position[k] + (thickness - contact->depth) * cell->normal[k];
    }
    add_spring(load, arm, force_back, turned);
}

/* Lower bound of the distance (metres) between the electrodes of a board and the object, from the bounding sphere of the
 * board and the bounding sphere and surfaces of the object. */
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

/* Whether board and object are certainly farther apart than `reach` (metres). False does not imply a contact. */
bool contact_is_far(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                    double reach)
{
    return bound_distance(patch, shape, object_from_bracket) > reach;
}

/* Lower bound of the distance (metres) from the electrodes of a square of skin to the object, by a test of one cell.
 * size: bound of the distance between cells of a square, metres. */
static double bound_square_distance(const struct cell *cells, double size, const struct shape *shape,
                                    const struct frame *object_from_bracket)
{
    double point[3];
    frame_point(object_from_bracket, cells[0].position, point);
    return shape_distance_bound(shape, point) - size;
}

/* Whether every cell of square number `square` is farther from the object than `thickness` + `reach` (metres), which
 * holds for most squares of a hand most of the time. Updates the clearance of the load, unless it is NULL. */
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

/* Add the motion of the board relative to the object since the last call to the travel: the shift of the bracket's
 * origin, and the turn times the largest distance of a cell from that origin. */
static void add_travel(struct contact_grip *grip, const struct patch *patch, const struct frame *object_from_bracket)
{
    double shift = 0.0, turn = 0.0;
    const double *c = patch->centre, size = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + patch->bound;
    for (int i = 0; grip->has_frame && i < 12; i++) {
        const double change = object_from_bracket->row[i / 4][i % 4] - grip->frame.row[i / 4][i % 4];
        *(i % 4 == 3 ? &shift : &turn) += change * change;
    }
    if (!grip->has_frame) {
        memset(grip->due, 0, (patch->taxel_count + patch->margin_count) * sizeof *grip->due);
        grip->travel = 0.0;
    }
    grip->has_frame = true;
    grip->frame = *object_from_bracket;
    grip->travel += sqrt(shift) + sqrt(turn) * size;
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

/* Solve the contact of the 16 cells of a square, whose first cell has the number `first`, along the placed lines. Writes
 * the compression of each cell in the direction of its normal (may be NULL). Returns whether a cell touches. */
static bool press_square(const struct cell *cells, size_t first, const struct shape *shape,
                         const struct shape_lines *lines, const struct frame *object_from_bracket, double thickness,
                         const struct contact_grip *grip, double *compression, struct contact_load *load)
{
    bool is_touching = false;
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        struct cell_contact contact;
        const double origin[3] = {lines->origin[0][i], lines->origin[1][i], lines->origin[2][i]};
        const double direction[3] = {lines->direction[0][i], lines->direction[1][i], lines->direction[2][i]};
        if (lines->entry[i] < thickness &&
            find_contact(shape, origin, direction, lines->entry[i], thickness, &contact)) {
            is_touching = true;
            const double along = contact.depth * fmin(fmax(contact.slope, 0.0) / STEEPEST, 1.0);
            if (compression) {
                compression[i] = along;
            }
            if (load && grip) {
                add_cell(load, &cells[i], first + i, &contact, object_from_bracket, thickness, grip);
            } else if (load) {
                add_column(load, &cells[i], along);
            }
        } else if (grip && grip->advances) {
            grip->sticks[first + i] = false;
        }
    }
    return is_touching;
}

/* Forget where the 16 cells from `first` on stick to the object, because they no longer touch it. */
static void release_square(const struct contact_grip *grip, size_t first)
{
    if (grip && grip->advances) {
        memset(&grip->sticks[first], 0, CELLS_PER_TAXEL * sizeof *grip->sticks);
    }
}

/* Add the load (wrench and stiffness) of the bare sheet beside the taxels. Returns whether that sheet touches the
 * object. */
static bool press_margins(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                          double thickness, struct contact_grip *grip, struct contact_load *load)
{
    bool is_touching = false;
    for (size_t square = 0; square < patch->margin_count; square++) {
        const struct cell *cells = &patch->margins[square * CELLS_PER_TAXEL];
        const size_t first = patch->cell_count + square * CELLS_PER_TAXEL;
        struct shape_lines lines;
        if (square_is_far(cells, patch->taxel_count + square, patch, shape, object_from_bracket, thickness, 0.0, grip,
                          load)) {
            release_square(grip, first);
            continue;
        }
        place_lines(&lines, cells, patch->reach, object_from_bracket);
        shape_entries(shape, &lines, fmax(thickness, DEEPEST_M));
        is_touching |= press_square(cells, first, shape, &lines, object_from_bracket, thickness, grip, NULL, load);
    }
    return is_touching;
}

/* Compress every cell to the depth at which the object enters the layer along the normal of the cell. Writes the
 * compression and the gap (metres) of each cell and the wrench and stiffness of the board; returns whether the object
 * touches the board. Each cell is an independent spring. */
bool contact_solve(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                   double thickness, double reach, double *compression, double *gap, struct contact_load *load,
                   struct contact_grip *grip)
{
    bool is_touching = false;
    if (load) {
        memset(load, 0, sizeof *load);
        load->clearance = INFINITY;
    }
    memset(compression, 0, patch->cell_count * sizeof *compression);
    for (size_t i = 0; gap && i < patch->cell_count; i++) {
        gap[i] = CONTACT_FAR_M;
    }
    if (grip) {
        add_travel(grip, patch, object_from_bracket);
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
    for (size_t taxel = 0; taxel < patch->taxel_count; taxel++) {
        const size_t first = taxel * CELLS_PER_TAXEL;
        if (square_is_far(&patch->cells[first], taxel, patch, shape, object_from_bracket, thickness, reach, grip,
                          load)) {
            release_square(grip, first);
            continue;
        }
        struct shape_lines lines;
        place_lines(&lines, &patch->cells[first], patch->reach, object_from_bracket);
        shape_entries(shape, &lines, fmax(thickness + reach, DEEPEST_M));
        for (size_t i = 0; gap && i < CELLS_PER_TAXEL; i++) {
            if (lines.entry[i] >= -DEEPEST_M && lines.entry[i] <= thickness + reach) {
                gap[first + i] = fmax(lines.entry[i] - thickness, 0.0);
            }
        }
        is_touching |= press_square(&patch->cells[first], first, shape, &lines, object_from_bracket, thickness, grip,
                                    &compression[first], load);
    }
    if (load && press_margins(patch, shape, object_from_bracket, thickness, grip, load)) {
        is_touching = true;
    }
    return is_touching;
}
