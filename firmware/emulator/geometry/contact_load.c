#include "emulator/geometry/contact_load.h"

#include <math.h>
#include <string.h>

#include "emulator/physics/layer.h"

/* Sum of the loads of all faces of the object on one cell, in the object's frame. */
struct cell_contact {
    double normal[3]; /* of the object, outward; direction of the sum of the normal forces */
    /* point where the sum acts: offset from the middle of the cell's top in half sides, and depth below it in metres */
    double arm[3];
    double pressing; /* magnitude of the sum, newtons */
    double share;    /* of the area of the cell that the object touches */
};

/* Return whether the skin slides on the object: the shear force `reached`, which would act if the skin stuck, exceeds
 * the friction limit `limit` (both in newtons). */
bool contact_load_slides(double reached, double limit)
{
    return reached > limit;
}

/* Add the shear of cell number `cell` to a force (N) and a stiffness (N/m). The cell is a spring between its top, at
 * `top`, and the point of the object to which it sticks. Friction (coefficient times pressing force) limits the force
 * of the spring. The part of the cell that has touched the object only since this step is not sheared, so the
 * displacement is multiplied by the share of the contact area that stuck before. A sliding cell has no stiffness along
 * its shear, because the friction force does not grow. area: of the cell, square metres. If the grip advances, share
 * and point of the cell are updated. */
static void add_shear_spring(const struct contact_grip *grip, size_t cell, const double top[3],
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
    const bool is_sliding = contact_load_slides(reached, limit);
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

/* Rotate the load of a board from the object's frame to the bracket's frame. The stiffness has only its lower triangle
 * set before; afterwards it is complete. Both 3-vectors of each row and of each column of the stiffness are rotated. */
void contact_load_turn(const struct frame *object_from_bracket, struct contact_load *load)
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

/* Add force (N) and stiffness (N/m) of one cell to the load of the board, which is the wrench (force, moment) and the
 * 6 x 6 stiffness about the bracket's origin. The force acts at the point r (metres) of the object's surface.
 * The stiffness is that of a spring with the 3 x 3 matrix S at r: (I, [r]) S (I, [r])^T with the cross-product matrix
 * [r]. Only the lower triangle of the board's stiffness is set. */
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

/* Compute a point of a cell relative to the bracket's origin, in the object's frame. at: offset from the middle of the
 * cell in half sides. depth: below the top of the cell, metres. */
static void find_arm(const struct cover_cell *cell, const double at[2], double depth,
                     const struct frame *object_from_bracket, double arm[3])
{
    for (int k = 0; k < 3; k++) {
        arm[k] = cell->top[k] + at[0] * cell->half[0][k] + at[1] * cell->half[1][k] - depth * cell->normal[k] -
                 object_from_bracket->row[k][3];
    }
}

/* Return the depth (metres) of a face below the top of a cell at the centre of the face's pressure on the cell. */
static double compute_depth_at_centre(const struct cover_load *face)
{
    return face->face.depth + face->face.change[0] * face->centre[0] + face->face.change[1] * face->centre[1];
}

/* Sum the forces of the `count` faces of the object that press on a cell. Returns direction, magnitude (newtons) and
 * point of action of the sum, and the touched share of the cell. arm[0] and arm[1] are the offset of the point from the
 * middle of the cell in half sides; arm[2] is the depth of the point in metres. area: of the cell, square metres. */
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
        sum.arm[2] += force * compute_depth_at_centre(&faces[i]);
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

/* Add the stiffness against a rotation of a cell, which moves the centre of pressure on the cell: 1/3 is the mean
 * square offset from the middle in half sides. rate: stiffness of the cell along its normal, N/m. share: of the cell's
 * area that lies below the face; the result is exact for a share of 1. */
static void add_turning_stiffness(struct contact_load *load, const struct cover_cell *cell, double rate, double share)
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

/* Add the load of one cell that carries no shear to the load of the board: for each face of the object, a spring along
 * the normal of the cell in the face's centre of pressure. The factor slope / steep (cover.h) reduces the load of a
 * face that is inclined by more than 60 degrees. The stiffness contains the square of this factor, because a motion
 * along the normal changes the depth of the face by slope / steep times the motion. area: of the cell, square metres.
 * thickness: layer above the electrode, metres. */
static void add_normal_springs(struct contact_load *load, const struct cover_cell *cell, double area,
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
        add_turning_stiffness(load, cell, rate, faces[face].share);
    }
}

/* Add the load of cell number `number`, which sticks to the object, to the load of the board. Each face presses along
 * the normal of the face. Up to an inclination of 60 degrees, the component of this force along the normal of the cell
 * is the pressure times the area. The shear acts at the point where the sum of the pressing forces acts; with one face,
 * this is the point of the face's force, and the shear is added to this force. area: of the cell, square metres. */
static void add_sticking_cell(struct contact_load *load, const struct cover_cell *cell, double area, size_t number,
                              const struct cover_load *faces, size_t count, const struct frame *object_from_bracket,
                              const struct contact_grip *grip)
{
    const struct cell_contact sum = join_faces(faces, count, area);
    double force[3] = {0.0, 0.0, 0.0}, spring[3][3] = {{0.0}}, arm[3];
    add_shear_spring(grip, number, cell->top, &sum, area, force, spring);
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
        find_arm(cell, faces[n].centre, compute_depth_at_centre(&faces[n]), object_from_bracket, arm);
        add_spring(load, arm, force, spring);
    }
}

/* Return cell number `cell` (0 to 15) of a square whose values are stored by coordinate. */
struct cover_cell contact_load_get_cell(const struct cover_square *square, size_t cell)
{
    struct cover_cell result;
    for (int k = 0; k < 3; k++) {
        result.top[k] = square->top[k][cell];
        result.normal[k] = square->normal[k][cell];
        result.half[0][k] = square->half[0][k][cell];
        result.half[1][k] = square->half[1][k][cell];
    }
    return result;
}

/* Add the load of one cell of a square to the load of a board: with shear if there is a grip, otherwise as springs
 * along the normal of the cell. */
void contact_load_add_cell(struct contact_load *load, const struct load_square *square, size_t cell,
                           const struct cover_load *faces, size_t count, double thickness,
                           const struct contact_grip *grip)
{
    const struct cover_cell place = contact_load_get_cell(square->places, cell);
    const double area = square->cells[cell].area;
    if (grip) {
        add_sticking_cell(load, &place, area, square->first + cell, faces, count, square->object_from_bracket, grip);
    } else {
        add_normal_springs(load, &place, area, faces, count, thickness, square->object_from_bracket);
    }
}
