#include "emulator/geometry/contact.h"

#include <math.h>
#include <string.h>

#include "emulator/geometry/cover.h"
#include "emulator/physics/layer.h"

#define DEEPEST_M 0.006 /* a surface deeper below the electrode does not limit the compression */

/* Sum of the loads of all faces on one cell, in the object's frame. */
struct cell_contact {
    double normal[3]; /* of the object, outward; direction of the sum of the normal forces */
    double arm[3]; /* point where the sum acts, from the middle of the cell's top: in half sides, and depth (metres) */
    double pressing; /* magnitude of the sum, newtons */
    double share;    /* of the area of the cell that the object touches */
};

/* Add the shear of cell number `cell`, whose top is at `top`: force (newtons) of a spring to the point where the cell
 * sticks to the object, and its stiffness. A part of the cell that touches the object anew is not sheared: as the touched
 * share of the cell grows, the point where the cell sticks moves towards the top. */
static void add_grip(const struct contact_grip *grip, size_t cell, const double top[3],
                     const struct cell_contact *contact, double area, double force[3], double stiffness[3][3])
{
    const double *n = contact->normal, spring = layer_shear_stiffness() * area * contact->share;
    const double new_share = fmax(1.0 - grip->stuck[cell] / contact->share, 0.0);
    double shear[3] = {0.0, 0.0, 0.0}, square = 0.0;
    if (grip->stuck[cell] > 0.0) {
        double along = 0.0;
        for (int k = 0; k < 3; k++) {
            shear[k] = (1.0 - new_share) * (top[k] - grip->point[cell][k]);
            along += shear[k] * n[k];
        }
        for (int k = 0; k < 3; k++) {
            shear[k] -= along * n[k];
            square += shear[k] * shear[k];
        }
    }
    const double limit = grip->coefficient * contact->pressing, reached = spring * sqrt(square);
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
        grip->stuck[cell] = contact->share;
        for (int k = 0; k < 3; k++) {
            grip->point[cell][k] = top[k] - rate / spring * shear[k];
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

/* Rotate the load of a board from the object's frame to the bracket's frame, and complete its stiffness K, of which only
 * the lower triangle is set: both 3-vectors of each row and of each column turn. */
static void turn_load(const struct frame *object_from_bracket, struct contact_load *load)
{
    double half[6][6], turned[3];
    for (int i = 0; i < 6; i++) {
        for (int j = i + 1; j < 6; j++) {
            load->stiffness[i][j] = load->stiffness[j][i];
        }
        rotate_back(object_from_bracket, &load->stiffness[i][0], &half[i][0]);
        rotate_back(object_from_bracket, &load->stiffness[i][3], &half[i][3]);
    }
    for (int part = 0; part < 6; part += 3) {
        rotate_back(object_from_bracket, &load->wrench[part], turned);
        memcpy(&load->wrench[part], turned, sizeof turned);
        for (int j = 0; j < 6; j++) {
            const double column[3] = {half[part][j], half[part + 1][j], half[part + 2][j]};
            rotate_back(object_from_bracket, column, turned);
            for (int k = 0; k < 3; k++) {
                load->stiffness[part + k][j] = turned[k];
            }
        }
    }
}

/* Add force and stiffness of one cell to the load of the board: the force acts at the point r on the object's surface,
 * and the stiffness is that of a spring S at r: (I, [r]) S (I, [r])^T with the cross-product matrix [r]. Only the lower
 * triangle of the stiffness is set. */
static void add_spring(struct contact_load *load, const double r[3], const double force[3], double spring[3][3])
{
    double product[3][3]; /* [r] S */
    for (int j = 0; j < 3; j++) {
        product[0][j] = r[1] * spring[2][j] - r[2] * spring[1][j];
        product[1][j] = r[2] * spring[0][j] - r[0] * spring[2][j];
        product[2][j] = r[0] * spring[1][j] - r[1] * spring[0][j];
        load->wrench[j] += force[j];
    }
    load->wrench[3] += r[1] * force[2] - r[2] * force[1];
    load->wrench[4] += r[2] * force[0] - r[0] * force[2];
    load->wrench[5] += r[0] * force[1] - r[1] * force[0];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            load->stiffness[i][j] += spring[i][j];
            load->stiffness[3 + i][j] += product[i][j];
        }
        load->stiffness[3 + i][3] += product[i][2] * r[1] - product[i][1] * r[2];
        load->stiffness[3 + i][4] += product[i][0] * r[2] - product[i][2] * r[0];
        load->stiffness[3 + i][5] += product[i][1] * r[0] - product[i][0] * r[1];
    }
}

/* Point of a cell relative to the bracket's origin, in the object's frame. at: in half sides from the middle of the cell.
 * depth: below the top, metres. */
static void find_arm(const struct cover_cell *cell, const double at[2], double depth,
                     const struct frame *object_from_bracket, double arm[3])
{
    for (int k = 0; k < 3; k++) {
        arm[k] = cell->top[k] + at[0] * cell->half[0][k] + at[1] * cell->half[1][k] - depth * cell->normal[k] -
                 object_from_bracket->row[k][3];
    }
}

/* Depth of a face at the centre of its pressure on a cell, metres. */
static double get_depth(const struct cover_load *face)
{
    return face->face.depth + face->face.change[0] * face->centre[0] + face->face.change[1] * face->centre[1];
}

/* Sum the forces of the faces on a cell: direction, point and magnitude. area: of the cell, square metres. */
static struct cell_contact join_faces(const struct cover_load *faces, size_t count, double area)
{
    struct cell_contact sum = {.share = 0.0};
    double total = 0.0;
    for (size_t i = 0; i < count; i++) {
        const double force = faces[i].pressure * area / faces[i].face.steep;
        for (int k = 0; k < 3; k++) {
            sum.normal[k] += force * faces[i].face.normal[k];
        }
        sum.arm[0] += force * faces[i].centre[0];
        sum.arm[1] += force * faces[i].centre[1];
        sum.arm[2] += force * get_depth(&faces[i]);
        sum.share += faces[i].share;
        total += force;
    }
    sum.pressing = sqrt(sum.normal[0] * sum.normal[0] + sum.normal[1] * sum.normal[1] + sum.normal[2] * sum.normal[2]);
    for (int k = 0; k < 3; k++) {
        sum.normal[k] /= sum.pressing > 0.0 ? sum.pressing : 1.0;
        sum.arm[k] /= total;
    }
    return sum;
}

/* Add the stiffness of the pressure on a cell against a turn of the cell, which moves the centre of pressure. rate: of the
 * cell, N/m. share: of the area of the cell below the face; the stiffness is exact where the face covers the cell. */
static void add_turn(struct contact_load *load, const struct cover_cell *cell, double rate, double share)
{
    const double *n = cell->normal;
    for (int side = 0; side < 2; side++) {
        const double *h = cell->half[side];
        const double arm[3] = {h[1] * n[2] - h[2] * n[1], h[2] * n[0] - h[0] * n[2], h[0] * n[1] - h[1] * n[0]};
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j <= i; j++) {
                load->stiffness[3 + i][3 + j] += rate * share * share / 3.0 * arm[i] * arm[j];
            }
        }
    }
}

/* Add the load of one cell that carries no shear to the wrench on the board and to the stiffness: a spring along the
 * normal of the cell in the centre of pressure of each face. area: of the cell, square metres. */
static void add_column(struct contact_load *load, const struct cover_cell *cell, double area,
                       const struct cover_load *faces, size_t count, double thickness,
                       const struct frame *object_from_bracket)
{
    const double *n = cell->normal;
    for (size_t face = 0; face < count; face++) {
        const double share = fmax(faces[face].face.slope, 0.0) / faces[face].face.steep * area;
        const double rate = share * share / area * faces[face].rate;
        double force[3], spring[3][3], arm[3];
        for (int i = 0; i < 3; i++) {
            force[i] = -share * faces[face].pressure * n[i];
            for (int j = 0; j < 3; j++) {
                spring[i][j] = rate * n[i] * n[j];
            }
        }
        find_arm(cell, faces[face].centre, thickness, object_from_bracket, arm);
        add_spring(load, arm, force, spring);
        add_turn(load, cell, rate, faces[face].share);
    }
}

/* Add the load of cell number `number`, which sticks to the object, to the wrench on the board and to the stiffness. The
 * force of each face has the direction of the face's normal; its part along the cell follows from the compression. The
 * shear acts in the centre of these forces. */
static void add_cell(struct contact_load *load, const struct cover_cell *cell, double area, size_t number,
                     const struct cover_load *faces, size_t count, const struct frame *object_from_bracket,
                     const struct contact_grip *grip)
{
    const struct cell_contact sum = join_faces(faces, count, area);
    double force[3] = {0.0, 0.0, 0.0}, spring[3][3] = {{0.0}}, arm[3];
    add_grip(grip, number, cell->top, &sum, area, force, spring);
    if (count > 1) {
        find_arm(cell, sum.arm, sum.arm[2], object_from_bracket, arm);
        add_spring(load, arm, force, spring);
    }
    for (size_t n = 0; n < count; n++) {
        const struct cover_face *face = &faces[n].face;
        const double pressing = faces[n].pressure * area / face->steep;
        const double rate = faces[n].rate * area / (face->steep * face->steep);
        for (int i = 0; i < 3; i++) {
            force[i] = (count > 1 ? 0.0 : force[i]) + pressing * face->normal[i];
            for (int j = 0; j < 3; j++) {
                spring[i][j] = (count > 1 ? 0.0 : spring[i][j]) + rate * face->normal[i] * face->normal[j];
            }
        }
        find_arm(cell, faces[n].centre, get_depth(&faces[n]), object_from_bracket, arm);
        add_spring(load, arm, force, spring);
    }
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

/* Middle of a square of skin, between two opposite corner cells, in the object's frame. */
static void find_middle(const struct cell *cells, const struct frame *object_from_bracket, double middle[3])
{
    double point[3];
    for (int k = 0; k < 3; k++) {
        point[k] = 0.5 * (cells[0].position[k] + cells[CELLS_PER_TAXEL - 1].position[k]);
    }
    frame_point(object_from_bracket, point, middle);
}

/* Lower bound of the distance (metres) from the electrodes of a square of skin to the object, by a test of its middle.
 * size: bound of the distance between points of a square, metres. */
static double bound_square_distance(const struct cell *cells, double size, const struct shape *shape,
                                    const struct frame *object_from_bracket)
{
    double middle[3];
    find_middle(cells, object_from_bracket, middle);
    return shape_distance_bound(shape, middle) - 0.5 * size;
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

/* Transform the cells of a square to the object's frame, with the tops of the unloaded layer as their middles. */
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

/* Cell number i of a placed square. */
static struct cover_cell get_cell(const struct cover_square *square, size_t i)
{
    struct cover_cell cell;
    for (int k = 0; k < 3; k++) {
        cell.top[k] = square->top[k][i];
        cell.normal[k] = square->normal[k][i];
        cell.half[0][k] = square->half[0][k][i];
        cell.half[1][k] = square->half[1][k][i];
    }
    return cell;
}

/* Mean pressure (Pa) along the normal of a cell. */
static double sum_along(const struct cover_load *faces, size_t count)
{
    double pressure = 0.0;
    for (size_t i = 0; i < count; i++) {
        pressure += fmax(faces[i].face.slope, 0.0) / faces[i].face.steep * faces[i].pressure;
    }
    return pressure;
}

/* Solve the contact of the 16 cells of a square, whose first cell has the number `first`. Writes the compression of each
 * cell in the direction of its normal (may be NULL). Returns whether a cell touches. */
static bool press_square(const struct cell *cells, size_t first, const struct shape *shape, double size,
                         const struct frame *object_from_bracket, double thickness, const struct contact_grip *grip,
                         double *compression, struct contact_load *load)
{
    struct cover_planes planes;
    struct cover_square square;
    double middle[3];
    bool is_touching = false, touched[CELLS_PER_TAXEL];
    find_middle(cells, object_from_bracket, middle);
    cover_find_planes(shape, middle, 0.5 * size + thickness, DEEPEST_M, &planes);
    place_square(&square, cells, thickness, object_from_bracket);
    cover_find_touched(shape, &planes, &square, touched);
    for (size_t i = 0; i < CELLS_PER_TAXEL; i++) {
        struct cover_cell cover;
        struct cover_load faces[COVER_FACES_MAX];
        size_t count = 0;
        if (touched[i]) {
            cover = get_cell(&square, i);
            count = cover_press(shape, &planes, &cover, faces);
        }
        if (count) {
            is_touching = true;
            if (compression) {
                compression[i] = layer_contact_compression(sum_along(faces, count));
            }
            if (load && grip) {
                add_cell(load, &cover, cells[i].area, first + i, faces, count, object_from_bracket, grip);
            } else if (load) {
                add_column(load, &cover, cells[i].area, faces, count, thickness, object_from_bracket);
            }
        } else if (grip && grip->advances) {
            grip->stuck[first + i] = 0.0;
        }
    }
    return is_touching;
}

/* Forget where the 16 cells from `first` on stick to the object, because they no longer touch it. */
static void release_square(const struct contact_grip *grip, size_t first)
{
    if (grip && grip->advances) {
        memset(&grip->stuck[first], 0, CELLS_PER_TAXEL * sizeof *grip->stuck);
    }
}

/* Write the gaps (metres) up to `reach` of the cells of a square along their normals. */
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

/* Add the load (wrench and stiffness) of the bare sheet beside the taxels. Returns whether that sheet touches the
 * object. */
static bool press_margins(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                          double thickness, struct contact_grip *grip, struct contact_load *load)
{
    bool is_touching = false;
    for (size_t square = 0; square < patch->margin_count; square++) {
        const struct cell *cells = &patch->margins[square * CELLS_PER_TAXEL];
        const size_t first = patch->cell_count + square * CELLS_PER_TAXEL;
        if (square_is_far(cells, patch->taxel_count + square, patch, shape, object_from_bracket, thickness, 0.0, grip,
                          load)) {
            release_square(grip, first);
            continue;
        }
        is_touching |=
            press_square(cells, first, shape, patch->reach, object_from_bracket, thickness, grip, NULL, load);
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
    if (compression) {
        memset(compression, 0, patch->cell_count * sizeof *compression);
    }
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
        if (gap) {
            write_gaps(&patch->cells[first], shape, patch->reach, object_from_bracket, thickness, reach, &gap[first]);
        }
        is_touching |= press_square(&patch->cells[first], first, shape, patch->reach, object_from_bracket, thickness,
                                    grip, compression ? &compression[first] : NULL, load);
    }
    if (load && press_margins(patch, shape, object_from_bracket, thickness, grip, load)) {
        is_touching = true;
    }
    if (load && is_touching) {
        turn_load(object_from_bracket, load);
    }
    return is_touching;
}
