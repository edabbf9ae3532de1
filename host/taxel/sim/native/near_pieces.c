#include "near_pieces.h"

#include <math.h>
#include <string.h>

#include "layer_lines.h"

/* Return the solid with only those faces that the near pieces of a board can touch, as the last search found them. A
   cylinder (`faces` is 0) is returned unchanged. */
struct sim_solid sim_select_near_faces(const struct sim_layer *layer, size_t board)
{
    struct sim_solid solid = layer->solid;
    if (solid.faces) {
        solid.faces = layer->near_faces[board];
        solid.normals = layer->near_normals + 3 * layer->solid.faces * board;
        solid.offsets = layer->near_offsets + layer->solid.faces * board;
    }
    return solid;
}

/* Return an upper bound (metres) of the displacement of a point at most `size` metres from the bracket's origin between
   two poses of the bracket (4 x 4, by rows): shift of the origin, plus `size` times the Frobenius norm of the change of
   the rotation matrix. */
double sim_bound_motion(const double *from, const double *to, double size)
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

/* Find the near pieces among the pieces [begin, end) of a board: those that may touch the solid before the board has
   moved by near_m. Stores their indices in `near`, in ascending order; returns their number. pose: 4 x 4, by rows,
   converts coordinates of the board's bracket to those of the solid. */
static size_t find_near_pieces(const struct sim_layer *layer, const double *pose, size_t begin, size_t end,
                               uint32_t *near)
{
    const double reach = layer->thickness_m + layer->near_m + layer->piece_size_m;
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

/* Find the near pieces among the pieces [begin, end) of complete squares of the sheet. Parameters and result are those
   of find_near_pieces(). A square whose middle piece is too far away is skipped after one test. */
static size_t find_near_in_squares(const struct sim_layer *layer, const double *pose, size_t begin, size_t end,
                                   uint32_t *near)
{
    const double reach = layer->thickness_m + layer->near_m + layer->square_size_m + layer->piece_size_m;
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

/* Store in near_normals and near_offsets of a board the faces of a polytope that can indent a near piece of the board
   before the next search, in the order of the solid, and their number in near_faces. A near piece, which is listed in
   `near`, may touch the solid before the board has moved by near_m. pose: 4 x 4, by rows, converts coordinates of the
   board's bracket to those of the solid.

   A face is stored if the height of at least one near piece over its plane is min_height (negative) or more. All near
   pieces lie so deep behind any other face that a nearer face determines their indentation. If no face meets the
   condition, because all near pieces lie deep inside the solid or because there are none, all faces are stored. For a
   cylinder, which has no faces, the number is 0. */
static void find_faces(struct sim_layer *layer, size_t board, const double *pose)
{
    const uint32_t *near = layer->near + layer->first[board];
    const size_t faces = layer->solid.faces;
    const double min_height = -(layer->max_depth_m + layer->thickness_m + layer->near_m + layer->piece_size_m);
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
    if (!stored && faces) { /* all pieces are far inside the solid, or there are none */
        memcpy(normals, layer->solid.normals, 3 * faces * sizeof *normals);
        memcpy(offsets, layer->solid.offsets, faces * sizeof *offsets);
        stored = faces;
    }
    layer->near_faces[board] = stored;
}

/* Discard the anchors of the board's pieces that are not near: these pieces touch the solid anew when they return. */
static void release_far_pieces(struct sim_layer *layer, size_t board)
{
    const uint32_t *near = layer->near + layer->first[board];
    size_t next = 0;
    for (size_t piece = layer->first[board]; piece < layer->first[board + 1]; piece++) {
        if (next < layer->near_count[board] && near[next] == piece) {
            next++;
        } else {
            layer->touched[piece] = 0.0;
        }
    }
}

/* Find the near pieces and faces of a board at `pose` in the solid's frame, and store the motion (slack, metres) up to
   which the result remains valid: near_m, or the clearance of a board that is farther away and has no near pieces. */
void sim_search_near(struct sim_layer *layer, size_t board, const double *pose)
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
    release_far_pieces(layer, board);
}
