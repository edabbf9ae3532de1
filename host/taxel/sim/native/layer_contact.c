#include "layer_contact.h"

#include <math.h>
#include <string.h>

#define TWIST 6

size_t sim_layer_struct_size(void)
{
    return sizeof(struct sim_layer);
}

/* Pose of b in the frame of a: inverse(a) b of two rigid transforms (4 x 4, by rows). */
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

/* Component `row` (x, y or z) of a vector rotated by a pose (4 x 4, by rows). */
static double rotate_row(const double *pose, size_t row, const double *vector)
{
    return pose[4 * row] * vector[0] + pose[4 * row + 1] * vector[1] + pose[4 * row + 2] * vector[2];
}

/* Set point i of the lines to the position of a piece of a board in the solid's frame; `pose`: of the board in that
   frame. */
static void set_point(const struct sim_layer *layer, const double *pose, size_t piece, struct sim_lines *lines,
                      size_t i)
{
    for (size_t row = 0; row < 3; row++) {
        lines->point[row][i] = rotate_row(pose, row, layer->position + 3 * piece) + pose[4 * row + 3];
    }
}

/* The solid reduced to the faces that the near pieces of a board can touch, which the last search has found. */
static struct sim_solid select_near_faces(const struct sim_layer *layer, size_t board)
{
    struct sim_solid solid = layer->solid;
    if (solid.faces) {
        solid.faces = layer->near_faces[board];
        solid.normals = layer->near_normals + 3 * layer->solid.faces * board;
        solid.offsets = layer->near_offsets + layer->solid.faces * board;
    }
    return solid;
}

/* Number of lines of the next block, out of the lines that remain. */
static size_t limit_to_block(size_t remaining)
{
    return remaining < RAY_BLOCK ? remaining : RAY_BLOCK;
}

/* Upper bound of the motion between two poses of a piece at most `size` from the bracket's origin, metres. */
static double bound_motion(const double *from, const double *to, double size)
{
    double turn = 0.0, shift = 0.0;
    for (size_t row = 0; row < 3; row++) {
        for (size_t i = 4 * row; i < 4 * row + 3; i++) {
            turn += (to[i] - from[i]) * (to[i] - from[i]);
        }
        shift += (to[4 * row + 3] - from[4 * row + 3]) * (to[4 * row + 3] - from[4 * row + 3]);
    }
    return sqrt(shift) + sqrt(turn) * size;
}

/* Find the pieces of [begin, end) that may touch the solid before the next search. Stores them in `near`, in order;
   returns their number. */
static size_t find_near_pieces(const struct sim_layer *layer, const double *pose, size_t begin, size_t end,
                               uint32_t *near)
{
    const double reach = layer->thickness_m + layer->near_m;
    size_t stored = 0;
    while (begin < end) {
        struct sim_lines lines;
        double bound[RAY_BLOCK];
        const size_t count = limit_to_block(end - begin);
        for (size_t i = 0; i < count; i++) {
            set_point(layer, pose, begin + i, &lines, i);
        }
        sim_distance_bounds(&layer->solid, &lines, count, bound);
        for (size_t i = 0; i < count; i++) {
            if (bound[i] < reach) {
                near[stored++] = (uint32_t)(begin + i);
            }
        }
        begin += count;
    }
    return stored;
}

/* Find the pieces of complete squares of the sheet that may touch the solid before the next search. As
   find_near_pieces(), but a square whose middle piece is too far is skipped with one test. */
static size_t find_near_in_squares(const struct sim_layer *layer, const double *pose, size_t begin, size_t end,
                                   uint32_t *near)
{
    const double reach = layer->thickness_m + layer->near_m + layer->square_size_m;
    const size_t size = layer->square_pieces;
    size_t stored = 0;
    while (begin < end) {
        struct sim_lines lines;
        double bound[RAY_BLOCK];
        const size_t count = limit_to_block((end - begin) / size);
        for (size_t i = 0; i < count; i++) {
            set_point(layer, pose, begin + i * size + size / 2, &lines, i);
        }
        sim_distance_bounds(&layer->solid, &lines, count, bound);
        for (size_t i = 0; i < count; i++) {
            if (bound[i] < reach) {
                stored += find_near_pieces(layer, pose, begin + i * size, begin + (i + 1) * size, near + stored);
            }
        }
        begin += count * size;
    }
    return stored;
}

/* Find the faces of a polytope through which a line of a near piece can enter before the next search. Behind any other
   face the pieces lie so deep that an entry through the face is below the largest depth that counts. */
static void find_faces(struct sim_layer *layer, size_t board, const double *pose)
{
    const uint32_t *near = layer->near + layer->first[board];
    const size_t faces = layer->solid.faces;
    const double max_depth = layer->max_depth_m > layer->thickness_m ? layer->max_depth_m : layer->thickness_m;
    const double min_height = -(max_depth + layer->near_m);
    double *normals = layer->near_normals + 3 * faces * board, *offsets = layer->near_offsets + faces * board;
    double *max_height = offsets; /* of the pieces over each face; read before an offset replaces the height */
    for (size_t face = 0; face < faces; face++) {
        max_height[face] = -INFINITY;
    }
    for (size_t begin = 0; begin < layer->near_count[board]; begin += RAY_BLOCK) {
        struct sim_lines lines;
        const size_t count = limit_to_block(layer->near_count[board] - begin);
        for (size_t i = 0; i < count; i++) {
            set_point(layer, pose, near[begin + i], &lines, i);
        }
        for (size_t face = 0; face < faces; face++) {
            if (max_height[face] < min_height) {
                max_height[face] = sim_max_height(&layer->solid, face, &lines, count);
            }
        }
    }
    size_t stored = 0;
    for (size_t face = 0; face < faces; face++) {
        if (max_height[face] >= min_height) {
            memcpy(normals + 3 * stored, layer->solid.normals + 3 * face, 3 * sizeof *normals);
            offsets[stored++] = layer->solid.offsets[face];
        }
    }
    layer->near_faces[board] = stored;
    if (faces && !stored) {
        layer->near_count[board] = 0;
    }
}

/* Find the near pieces and faces of a board at `pose` in the solid's frame, and the motion (slack, metres) up to which
   they remain valid. A far board has no near pieces, and its slack is its clearance. */
static void search_board(struct sim_layer *layer, size_t board, const double *pose)
{
    const size_t begin = layer->first[board], end = layer->first[board + 1];
    struct sim_lines origin;
    double bound;
    for (size_t row = 0; row < 3; row++) {
        origin.point[row][0] = pose[4 * row + 3];
    }
    sim_distance_bounds(&layer->solid, &origin, 1, &bound);
    const double clearance = bound - layer->board_size[board] - layer->thickness_m;
    memcpy(layer->search_pose + SIM_POSE * board, pose, SIM_POSE * sizeof *pose);
    layer->near_count[board] = 0;
    layer->slack_m[board] = clearance;
    if (clearance < layer->near_m) {
        layer->slack_m[board] = layer->near_m;
        layer->near_count[board] = find_near_in_squares(layer, pose, begin, end, layer->near + begin);
        find_faces(layer, board, pose);
    }
}

/* Force (newtons) of the layer on one taxel and its derivative `rate` (N/m) at a compression `depth` (metres):
   stiffness_n_per_m d exp(d / stiffening_m + (d / closing_m)^4), continued along its tangent above straight_m. */
static void apply_law(const struct sim_law *law, double depth, double *force, double *rate)
{
    const double curved = depth < law->straight_m ? depth : law->straight_m;
    const double stiffening = curved / law->stiffening_m, closing = curved / law->closing_m;
    const double fourth = closing * closing * closing * closing;
    const double growth = law->stiffness_n_per_m * exp(stiffening + fourth);
    *rate = (1.0 + stiffening + 4.0 * fourth) * growth;
    *force = curved * growth + (depth - curved) * *rate;
}

/* Add the force and the stiffness rate l l^T of one compressed piece to the load of its board, in the bracket's frame,
   with l = (n, r x n). Only the lower triangle of the stiffness is computed. */
static void add_piece(const struct sim_layer *layer, size_t piece, double force, double rate, double *wrench,
                      double *stiffness)
{
    const double *n = layer->normal + 3 * piece, *p = layer->position + 3 * piece;
    const double line[TWIST] = {
        n[0], n[1], n[2], p[1] * n[2] - p[2] * n[1], p[2] * n[0] - p[0] * n[2], p[0] * n[1] - p[1] * n[0]};
    for (size_t i = 0; i < TWIST; i++) {
        const double scaled = rate * line[i];
        wrench[i] -= force * line[i];
        for (size_t j = 0; j <= i; j++) {
            stiffness[TWIST * i + j] += scaled * line[j];
        }
    }
}

/* Rotate a wrench (force and moment) from the bracket's frame to the world; the point of reference is unchanged. */
static void rotate_wrench(const double *pose, double *wrench)
{
    for (size_t half = 0; half < TWIST; half += 3) {
        const double vector[3] = {wrench[half], wrench[half + 1], wrench[half + 2]};
        for (size_t row = 0; row < 3; row++) {
            wrench[half + row] = rotate_row(pose, row, vector);
        }
    }
}

/* Rotate a 6 x 6 stiffness K, given as its lower triangle, from the bracket's frame to the world: T K T^t. T is applied
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

/* Find the pieces of a block that are nearer to the solid than the thickness of the layer; no other piece can be
   compressed. Stores the pieces and the lines along their normals; returns their number. */
static size_t select_lines(const struct sim_layer *layer, const struct sim_solid *solid, const double *pose,
                           const uint32_t *near, size_t count, uint32_t *piece, struct sim_lines *lines)
{
    double bound[RAY_BLOCK];
    size_t stored = 0;
    for (size_t i = 0; i < count; i++) {
        set_point(layer, pose, near[i], lines, i);
    }
    sim_distance_bounds(solid, lines, count, bound);
    for (size_t i = 0; i < count; i++) {
        if (bound[i] < layer->thickness_m) {
            for (size_t row = 0; row < 3; row++) {
                lines->point[row][stored] = lines->point[row][i];
                lines->direction[row][stored] = rotate_row(pose, row, layer->normal + 3 * (size_t)near[i]);
            }
            piece[stored++] = near[i];
        }
    }
    return stored;
}

/* Add the wrench, the stiffness and the taxel forces of one board at `pose` in the solid's frame; returns whether the
   board is in contact. Each piece is a spring with the share of the force law that its area has. */
static int load_board(const struct sim_layer *layer, size_t board, const double *pose, double *wrench,
                      double *stiffness, double *taxel_force)
{
    const uint32_t *near = layer->near + layer->first[board];
    const struct sim_solid solid = select_near_faces(layer, board);
    int has_contact = 0;
    for (size_t begin = 0; begin < layer->near_count[board]; begin += RAY_BLOCK) {
        struct sim_lines lines;
        double entry[RAY_BLOCK];
        uint32_t piece[RAY_BLOCK];
        const size_t block = limit_to_block(layer->near_count[board] - begin);
        const size_t count = select_lines(layer, &solid, pose, near + begin, block, piece, &lines);
        sim_entries(&solid, &lines, count, entry);
        for (size_t i = 0; i < count; i++) {
            const double depth = layer->thickness_m - entry[i];
            if (depth > 0.0 && depth < layer->thickness_m + layer->max_depth_m) {
                const uint32_t taxel = layer->taxel[piece[i]];
                const double share = layer->area_share[piece[i]];
                double force, rate;
                apply_law(&layer->law, depth, &force, &rate);
                add_piece(layer, piece[i], share * force, share * rate, wrench, stiffness);
                if (taxel_force && taxel != SIM_NO_TAXEL) {
                    taxel_force[taxel] += share * force;
                }
                has_contact = 1;
            }
        }
    }
    return has_contact;
}

/* Wrench and stiffness on each board from its contact with the solid, in the world, and the force on each taxel. The
   near pieces of a board are searched again only after the board has moved farther, relative to the solid, than the
   slack of the last search. */
void sim_layer_load(struct sim_layer *layer, const double *poses, const double *solid_pose, double *wrench,
                    double *stiffness, double *taxel_force)
{
    memset(wrench, 0, layer->boards * TWIST * sizeof *wrench);
    memset(stiffness, 0, layer->boards * TWIST * TWIST * sizeof *stiffness);
    for (size_t board = 0; board < layer->boards; board++) {
        const double *pose = poses + SIM_POSE * board;
        double in_solid[SIM_POSE];
        compute_relative_pose(solid_pose, pose, in_solid);
        const double moved = bound_motion(layer->search_pose + SIM_POSE * board, in_solid, layer->board_size[board]);
        if (layer->slack_m[board] < 0.0 || moved > layer->slack_m[board]) {
            search_board(layer, board, in_solid);
        }
        double *board_wrench = wrench + TWIST * board, *board_stiffness = stiffness + TWIST * TWIST * board;
        if (load_board(layer, board, in_solid, board_wrench, board_stiffness, taxel_force)) {
            rotate_wrench(pose, board_wrench);
            rotate_stiffness(pose, board_stiffness);
        }
    }
}
