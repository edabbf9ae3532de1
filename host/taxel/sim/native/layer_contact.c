#include "layer_contact.h"

#include <math.h>
#include <string.h>

#include "layer_lines.h"
#include "near_pieces.h"

#define TWIST 6

size_t sim_layer_struct_size(void)
{
    return sizeof(struct sim_layer);
}

/* Compute the pose of b in the frame of a: inverse(a) b of two rigid transforms (4 x 4, by rows). */
static void compute_relative_pose(const double *a, const double *b, double *result)
{
    for (size_t i = 0; i < 3; i++) {
        for (size_t j = 0; j < 4; j++) {
            result[4 * i + j] = 0.0;
            for (size_t k = 0; k < 3; k++) {
                result[4 * i + j] += a[4 * k + i] * (b[4 * k + j] - (j == 3 ? a[4 * k + 3] : 0.0));
            }
        }
    }
    memcpy(result + 12, b + 12, 4 * sizeof *b);
}

static double larger_of(double a, double b)
{
    return a > b ? a : b;
}

/* Compute the force (newtons) of the layer on one taxel and its derivative `rate` (N/m) at a compression d = `depth`
   (metres): stiffness_n_per_m d exp(d / stiffening_m + (d / closing_m)^4 + (d / solid_m)^16), continued along its
   tangent above straight_m. */
static void apply_law(const struct sim_law *law, double depth, double *force, double *rate)
{
    const double curved = depth < law->straight_m ? depth : law->straight_m;
    const double stiffening = curved / law->stiffening_m, closing = curved / law->closing_m;
    const double fourth = closing * closing * closing * closing;
    const double solid = curved / law->solid_m, square = solid * solid, eighth = square * square * square * square;
    const double sixteenth = eighth * eighth;
    const double growth = law->stiffness_n_per_m * exp(stiffening + fourth + sixteenth);
    *rate = (1.0 + stiffening + 4.0 * fourth + 16.0 * sixteenth) * growth;
    *force = curved * growth + (depth - curved) * *rate;
}

/* Contact of one part of a column, in the solid's frame: arm from the bracket's origin to the point of contact
   (metres), outward normal of the solid, force on the board (newtons) and its stiffness (N/m). */
struct column_contact {
    double arm[3], normal[3], force[3];
    double stiffness[3][3];
};

/* Compute the shear (metres) of a piece across the normal n: the displacement of its top from its anchor, the point of
   the solid to which it sticks. A part of the piece that touches the solid anew is not sheared: while the `touched`
   share of the piece's area grows, the mean shear decreases. Returns the length of the shear. */
static double find_shear(const struct sim_layer *layer, size_t piece, const double *top, const double *n,
                         double touched, double shear[3])
{
    const double before = layer->touched[piece], *anchor = layer->anchor + 3 * piece;
    const double sheared = touched > before ? before / touched : 1.0;
    double along = 0.0, square = 0.0;
    for (size_t k = 0; k < 3; k++) {
        shear[k] = before > 0.0 ? sheared * (top[k] - anchor[k]) : 0.0;
        along += shear[k] * n[k];
    }
    for (size_t k = 0; k < 3; k++) {
        shear[k] -= along * n[k];
        square += shear[k] * shear[k];
    }
    return sqrt(square);
}

/* Add the shear of a column to its contact: the force and stiffness of a spring between the column's top and the point
   of the solid to which it sticks (anchor). The force is limited to the friction coefficient times the normal force
   `pressing`; beyond this limit the column slides, and its anchor follows the top. touched: share of the piece's area
   that touches the solid. advance: not 0: store anchor and touched share. */
static void add_shear(struct sim_layer *layer, size_t piece, const double *top, double touched, double pressing,
                      int advance, struct column_contact *contact)
{
    const double *n = contact->normal;
    double *anchor = layer->anchor + 3 * piece, shear[3];
    const double length = find_shear(layer, piece, top, n, touched, shear);
    const double rate = layer->area_share[piece] * touched * layer->friction.stiffness_n_per_m;
    const double limit = layer->friction.coefficient * pressing;
    const int slides = rate * length > limit;
    const double spring = slides ? limit / length : rate;
    for (size_t i = 0; i < 3; i++) {
        contact->force[i] -= spring * shear[i];
        for (size_t j = 0; j < 3; j++) {
            /* A sliding column resists only motion across its direction of sliding. */
            const double slip = slides ? shear[i] * shear[j] / (length * length) : 0.0;
            contact->stiffness[i][j] += spring * ((i == j ? 1.0 : 0.0) - n[i] * n[j] - slip);
        }
    }
    if (advance) {
        layer->touched[piece] = touched;
        for (size_t k = 0; k < 3; k++) {
            anchor[k] = top[k] - shear[k] * (slides ? spring / rate : 1.0);
        }
    }
}

/* Add the cross product of a and (x, y, z) to `result`, whose components are `stride` numbers apart. */
static void add_cross(const double *a, double x, double y, double z, double *result, size_t stride)
{
    result[0] += a[1] * z - a[2] * y;
    result[stride] += a[2] * x - a[0] * z;
    result[2 * stride] += a[0] * y - a[1] * x;
}

/* Add the force f and the stiffness K of one column to the load of its board: wrench (f, r x f), stiffness
   (I; R) K (I; R)^T with the cross-product matrix R of the arm r. Only the lower triangle of the stiffness is set. All
   vectors are in the frame of the solid. */
static void add_column(const struct column_contact *contact, double *wrench, double *stiffness)
{
    const double *r = contact->arm, *f = contact->force;
    double turned[9] = {0.0}; /* R K */
    for (size_t j = 0; j < 3; j++) {
        add_cross(r, contact->stiffness[0][j], contact->stiffness[1][j], contact->stiffness[2][j], turned + j, 3);
        wrench[j] += f[j];
    }
    add_cross(r, f[0], f[1], f[2], wrench + 3, 1);
    for (size_t i = 0; i < 3; i++) {
        double *row = stiffness + TWIST * (3 + i);
        for (size_t j = 0; j < 3; j++) {
            stiffness[TWIST * i + j] += contact->stiffness[i][j];
            row[j] += turned[3 * i + j];
        }
        add_cross(r, turned[3 * i], turned[3 * i + 1], turned[3 * i + 2], row + 3, 1); /* a row of R K R^T */
    }
}

/* Rotate a wrench (force and moment) from the solid's frame to the world; the point of reference is unchanged. */
static void rotate_wrench(const double *pose, double *wrench)
{
    for (size_t half = 0; half < TWIST; half += 3) {
        const double vector[3] = {wrench[half], wrench[half + 1], wrench[half + 2]};
        for (size_t row = 0; row < 3; row++) {
            wrench[half + row] = rotate_row(pose, row, vector);
        }
    }
}

/* Rotate a 6 x 6 stiffness K, given as its lower triangle, from the solid's frame to the world: T K T^t. T is applied
   to the rows, the matrix is transposed, and both are repeated. */
static void rotate_stiffness(const double *pose, double *stiffness)
{
    for (size_t i = 0; i < TWIST; i++) {
        for (size_t j = 0; j < i; j++) {
            stiffness[TWIST * j + i] = stiffness[TWIST * i + j];
        }
    }
    for (size_t side = 0; side < 2; side++) {
        for (size_t i = 0; i < TWIST; i++) {
            rotate_wrench(pose, stiffness + TWIST * i);
        }
        for (size_t i = 0; i < TWIST; i++) {
            for (size_t j = 0; j < i; j++) {
                const double upper = stiffness[TWIST * i + j];
                stiffness[TWIST * i + j] = stiffness[TWIST * j + i];
                stiffness[TWIST * j + i] = upper;
            }
        }
    }
}

/* Find the pieces of a block that may be indented: their tops are inside the solid or near it. Stores their numbers in
   `piece` and their columns in `lines`; returns how many they are. advance: not 0: the other pieces of the block lose
   their anchors. */
static size_t select_columns(const struct sim_layer *layer, const struct sim_solid *solid, const double *pose,
                             const uint32_t *near, size_t count, int advance, uint32_t *piece, struct sim_lines *lines)
{
    double bound[RAY_BLOCK];
    size_t stored = 0;
    for (size_t i = 0; i < count; i++) {
        set_column(layer, pose, near[i], lines, i);
    }
    sim_distance_bounds(solid, lines, count, bound);
    for (size_t i = 0; i < count; i++) {
        if (bound[i] < layer->piece_size_m) {
            for (size_t row = 0; row < 3; row++) {
                lines->point[row][stored] = lines->point[row][i];
                lines->direction[row][stored] = lines->direction[row][i];
            }
            set_half_sides(layer, pose, near[i], lines, stored);
            piece[stored++] = near[i];
        } else if (advance) {
            layer->touched[near[i]] = 0.0;
        }
    }
    return stored;
}

/* Compute the contact of a part of column i without shear; its force has the direction of the solid's normal. The mean
   force over the part follows from two depths that have the part's mean and standard deviation of the depth. share:
   area of the piece divided by the area of the force law. Returns the force along the normal, newtons. */
static double press_part(const struct sim_layer *layer, const struct sim_part *part, const struct sim_lines *lines,
                         size_t i, const double *origin, double share, struct column_contact *contact)
{
    const struct sim_face *face = &part->face;
    double force[2], rate[2];
    apply_law(&layer->law, larger_of(part->depth - part->deviation, 0.0), &force[0], &rate[0]);
    apply_law(&layer->law, part->depth + part->deviation, &force[1], &rate[1]);
    /* The force law gives the component along the column's axis: the normal force is larger by 1 / slope. A motion
       along the normal changes the depth by 1 / slope as well. */
    const double pressing = 0.5 * (force[0] + force[1]) * share * part->share / face->limited;
    const double stiffness = 0.5 * (rate[0] + rate[1]) * share * part->share / (face->limited * face->limited);
    for (size_t k = 0; k < 3; k++) {
        contact->normal[k] = face->normal[k];
        contact->arm[k] = lines->point[k][i] + part->centre[0] * lines->half[0][k][i] +
                          part->centre[1] * lines->half[1][k][i] - part->depth * lines->direction[k][i] - origin[k];
        contact->force[k] = pressing * face->normal[k];
        for (size_t j = 0; j < 3; j++) {
            contact->stiffness[k][j] = stiffness * face->normal[k] * face->normal[j];
        }
    }
    return pressing;
}

/* Sums over the parts of one column. */
struct column_sum {
    double force[3], arm[3]; /* arm: weighted by the normal forces */
    double pressing;         /* sum of the normal forces of the parts */
    double touched;          /* share of the area */
    double along;            /* force along the axis */
};

/* Set the contact through which the shear of a column with several parts acts: its normal is the direction of the sum
   of the parts' normal forces, and its point is their centre; its force is 0. Returns the magnitude of the sum,
   newtons. */
static double join_parts(const struct column_sum *sum, struct column_contact *contact)
{
    const double *f = sum->force, magnitude = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    memset(contact, 0, sizeof *contact);
    for (size_t k = 0; k < 3; k++) {
        contact->normal[k] = magnitude > 0.0 ? f[k] / magnitude : 0.0;
        contact->arm[k] = sum->pressing > 0.0 ? sum->arm[k] / sum->pressing : 0.0;
    }
    return magnitude;
}

/* Add the load of column i with its `count` parts to wrench and stiffness of its board. advance: not 0: store where the
   column sticks to the solid. Returns the force along the axis of the column, newtons. */
static double load_column(struct sim_layer *layer, uint32_t piece, const double *pose, const struct sim_lines *lines,
                          size_t i, const struct sim_part *parts, size_t count, int advance, double *wrench,
                          double *stiffness)
{
    const double origin[3] = {pose[3], pose[7], pose[11]};
    const double top[3] = {lines->point[0][i], lines->point[1][i], lines->point[2][i]};
    const int has_friction = layer->friction.coefficient > 0.0;
    struct column_sum sum = {{0.0}, {0.0}, 0.0, 0.0, 0.0};
    struct column_contact contact;
    for (size_t n = 0; n < count; n++) {
        const double slope = parts[n].face.slope;
        const double pressing = press_part(layer, &parts[n], lines, i, origin, layer->area_share[piece], &contact);
        for (size_t k = 0; k < 3; k++) {
            sum.force[k] += contact.force[k];
            sum.arm[k] += pressing * contact.arm[k];
        }
        sum.pressing += pressing;
        sum.touched += parts[n].share;
        sum.along += slope > 0.0 ? pressing * slope : 0.0;
        if (count == 1 && has_friction) {
            add_shear(layer, piece, top, sum.touched, pressing, advance, &contact);
        }
        add_column(&contact, wrench, stiffness);
    }
    if (count > 1 && has_friction) {
        const double pressing = join_parts(&sum, &contact);
        add_shear(layer, piece, top, sum.touched, pressing, advance, &contact);
        add_column(&contact, wrench, stiffness);
    }
    return sum.along;
}

/* Add the wrench, the stiffness and the taxel forces of one board at `pose` in the solid's frame; returns whether the
   board is in contact. Each piece is a column, which is divided along the edges of the solid and bears force in
   proportion to its area. advance: not 0: store where the columns stick to the solid; a column without contact then
   loses its anchor. */
static int load_board(struct sim_layer *layer, size_t board, const double *pose, double *wrench, double *stiffness,
                      double *taxel_force, int advance)
{
    const uint32_t *near = layer->near + layer->first[board];
    const struct sim_solid solid = sim_select_near_faces(layer, board);
    int has_contact = 0;
    for (size_t begin = 0; begin < layer->near_count[board]; begin += RAY_BLOCK) {
        struct sim_lines lines;
        struct sim_ranges ranges;
        uint32_t piece[RAY_BLOCK];
        const size_t block = limit_to_block(layer->near_count[board] - begin);
        const size_t count = select_columns(layer, &solid, pose, near + begin, block, advance, piece, &lines);
        sim_bound_depths(&solid, &lines, count, layer->min_slope, &ranges);
        for (size_t i = 0; i < count; i++) {
            struct sim_part parts[SIM_PARTS_MAX];
            const size_t divided = sim_divide(&solid, &lines, i, layer->min_slope, &ranges, parts);
            if (!divided) {
                layer->touched[piece[i]] = advance ? 0.0 : layer->touched[piece[i]];
                continue;
            }
            const double force =
                load_column(layer, piece[i], pose, &lines, i, parts, divided, advance, wrench, stiffness);
            const uint32_t taxel = layer->taxel[piece[i]];
            if (taxel_force && taxel != SIM_NO_TAXEL) {
                taxel_force[taxel] += force;
            }
            has_contact = 1;
        }
    }
    return has_contact;
}

/* Compute wrench and stiffness on each board from its contact with the solid, in the world, and the force on each
   taxel; see layer_contact.h. The last search for the near pieces of a board remains valid until the board has moved,
   relative to the solid, by the distance slack_m; then the pieces are searched again. */
void sim_layer_load(struct sim_layer *layer, const double *poses, const double *solid_pose, double *wrench,
                    double *stiffness, double *taxel_force, int advance)
{
    memset(wrench, 0, layer->boards * TWIST * sizeof *wrench);
    memset(stiffness, 0, layer->boards * TWIST * TWIST * sizeof *stiffness);
    for (size_t board = 0; board < layer->boards; board++) {
        const double *pose = poses + SIM_POSE * board;
        double in_solid[SIM_POSE];
        compute_relative_pose(solid_pose, pose, in_solid);
        double moved = sim_bound_motion(layer->search_pose + SIM_POSE * board, in_solid, layer->board_size[board]);
        if (layer->slack_m[board] < 0.0 || moved > layer->slack_m[board]) {
            sim_search_near(layer, board, in_solid);
            moved = 0.0;
        }
        layer->clearance_m[board] = layer->near_count[board] ? 0.0 : layer->slack_m[board] - moved;
        double *board_wrench = wrench + TWIST * board, *board_stiffness = stiffness + TWIST * TWIST * board;
        if (load_board(layer, board, in_solid, board_wrench, board_stiffness, taxel_force, advance)) {
            rotate_wrench(solid_pose, board_wrench);
            rotate_stiffness(solid_pose, board_stiffness);
        }
    }
}
