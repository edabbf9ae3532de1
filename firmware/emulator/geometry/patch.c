#include "emulator/geometry/patch.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

struct layout {
    int tx_count, rx_count;
    int taxel_at[TAXEL_LINES_MAX][TAXEL_LINES_MAX]; /* -1: the crossing has no taxel */
};

/* The scalar product of two vectors. */
static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The vector product of two vectors, in `out`. */
static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Number the taxels in the order of the crossing map (one bit per crossing, by TX line). The firmware later rejects a
 * map whose taxel count differs from `taxels`; until then the map must not cause invalid accesses. */
static void read_layout(struct layout *layout, uint8_t tx_count, uint8_t rx_count, const uint8_t *map, size_t taxels)
{
    int taxel = 0;
    layout->tx_count = tx_count;
    layout->rx_count = rx_count;
    for (int tx = 0; tx < tx_count; tx++) {
        for (int rx = 0; rx < rx_count; rx++) {
            const int crossing = tx * rx_count + rx;
            const bool has_taxel = (map[crossing >> 3] >> (crossing & 7)) & 1;
            layout->taxel_at[tx][rx] = has_taxel && taxel < (int)taxels ? taxel++ : -1;
        }
    }
}

/* Taxel poses on a flat sheet, for worlds without taxel poses: x is distal, y is left, one pitch per line. */
static void place_flat(const struct layout *layout, struct taxel_pose *poses)
{
    for (int tx = 0; tx < layout->tx_count; tx++) {
        for (int rx = 0; rx < layout->rx_count; rx++) {
            if (layout->taxel_at[tx][rx] >= 0) {
                poses[layout->taxel_at[tx][rx]] = (struct taxel_pose){
                    .position = {-TAXEL_PITCH_M * tx, -TAXEL_PITCH_M * rx, 0.0},
                    .normal = {0.0, 0.0, 1.0},
                    .distal = {1.0, 0.0, 0.0},
                };
            }
        }
    }
}

/* Pose of the taxel at a crossing of TX and RX line; NULL if the crossing lies outside the board or has no taxel. */
static const struct taxel_pose *find_neighbour(const struct layout *layout, const struct taxel_pose *poses, int tx,
                                               int rx)
{
    if (tx < 0 || rx < 0 || tx >= layout->tx_count || rx >= layout->rx_count || layout->taxel_at[tx][rx] < 0) {
        return NULL;
    }
    return &poses[layout->taxel_at[tx][rx]];
}

/* Curvature of the sheet at a taxel (1/m): change of the normal per metre in the direction `along`, mean over the
 * neighbours on both sides; 0 without neighbours. */
static double compute_curvature(const struct taxel_pose *centre, const struct taxel_pose *const sides[2],
                                const double along[3])
{
    double sum = 0.0;
    int count = 0;
    for (int i = 0; i < 2; i++) {
        if (sides[i]) {
            double step[3], normal_change[3];
            for (int k = 0; k < 3; k++) {
                step[k] = sides[i]->position[k] - centre->position[k];
                normal_change[k] = sides[i]->normal[k] - centre->normal[k];
            }
            const double distance = dot(step, along);
            if (fabs(distance) > 0.2 * TAXEL_PITCH_M) {
                sum += dot(normal_change, along) / distance;
                count++;
            }
        }
    }
    return count ? sum / count : 0.0;
}

/* Place a cell at (a, b) metres from a taxel along its distal and left direction, on the paraboloid with the curvatures
 * bend_distal and bend_left (1/m). */
static void place_cell(struct cell *cell, const struct taxel_pose *pose, const double left[3], double a, double b,
                       double bend_distal, double bend_left)
{
    const double depth = 0.5 * (bend_distal * a * a + bend_left * b * b);
    double length = 0.0;
    for (int k = 0; k < 3; k++) {
        cell->position[k] = pose->position[k] + a * pose->distal[k] + b * left[k] - depth * pose->normal[k];
        cell->normal[k] = pose->normal[k] + bend_distal * a * pose->distal[k] + bend_left * b * left[k];
        length += cell->normal[k] * cell->normal[k];
    }
    for (int k = 0; k < 3; k++) {
        cell->normal[k] /= sqrt(length);
    }
}

/* Place the 4 x 4 cells of one taxel on a paraboloid through the taxel whose curvatures follow from the normals of the
 * neighbouring taxels, and enter them in the grid of the unrolled sheet. */
static void add_taxel_cells(struct patch *patch, const struct layout *layout, const struct taxel_pose *poses, int tx,
                            int rx)
{
    const int taxel = layout->taxel_at[tx][rx];
    const struct taxel_pose *pose = &poses[taxel];
    const struct taxel_pose *const along_tx[2] = {find_neighbour(layout, poses, tx - 1, rx),
                                                  find_neighbour(layout, poses, tx + 1, rx)};
    const struct taxel_pose *const along_rx[2] = {find_neighbour(layout, poses, tx, rx - 1),
                                                  find_neighbour(layout, poses, tx, rx + 1)};
    double left[3];
    cross(pose->normal, pose->distal, left);
    const double bend_distal = compute_curvature(pose, along_tx, pose->distal);
    const double bend_left = compute_curvature(pose, along_rx, left);
    for (int i = 0; i < CELLS_PER_TAXEL; i++) {
        const int row = i / CELLS_PER_SIDE, column = i % CELLS_PER_SIDE;
        const int index = taxel * CELLS_PER_TAXEL + i;
        const int grid = (tx * CELLS_PER_SIDE + row) * patch->grid_columns + rx * CELLS_PER_SIDE + column;
        const double a = (0.5 * (CELLS_PER_SIDE - 1) - row) * CELL_SIDE_M; /* TX 0 is distal, RX 0 is left */
        const double b = (0.5 * (CELLS_PER_SIDE - 1) - column) * CELL_SIDE_M;
        place_cell(&patch->cells[index], pose, left, a, b, bend_distal, bend_left);
        patch->cell_at[grid] = (int16_t)index;
        patch->grid_of[index] = grid;
    }
}

/* Compute the bounding sphere of the cells about their mean position. */
static void compute_bounding_sphere(struct patch *patch)
{
    memset(patch->centre, 0, sizeof patch->centre);
    for (size_t i = 0; i < patch->cell_count; i++) {
        for (int k = 0; k < 3; k++) {
            patch->centre[k] += patch->cells[i].position[k] / (double)patch->cell_count;
        }
    }
    patch->bound = 0.0;
    for (size_t i = 0; i < patch->cell_count; i++) {
        double square = 0.0;
        for (int k = 0; k < 3; k++) {
            const double d = patch->cells[i].position[k] - patch->centre[k];
            square += d * d;
        }
        patch->bound = fmax(patch->bound, sqrt(square));
    }
}

/* Build the cells of a board from its crossing map and the poses of its taxels (NULL: flat sheet). Returns 0, or -1 if
 * out of memory. */
int patch_init(struct patch *patch, uint8_t tx_count, uint8_t rx_count, const uint8_t *crossing_map, size_t taxel_count,
               const struct taxel_pose *poses)
{
    struct layout layout;
    struct taxel_pose flat[TAXEL_LINES_MAX * TAXEL_LINES_MAX];
    read_layout(&layout, tx_count, rx_count, crossing_map, taxel_count);
    if (!poses) {
        place_flat(&layout, flat);
        poses = flat;
    }
    patch->margin_count = 0;
    patch->margins = NULL;
    patch->taxel_count = taxel_count;
    patch->cell_count = taxel_count * CELLS_PER_TAXEL;
    patch->grid_rows = tx_count * CELLS_PER_SIDE;
    patch->grid_columns = rx_count * CELLS_PER_SIDE;
    const size_t grid = (size_t)patch->grid_rows * (size_t)patch->grid_columns;
    patch->cell_at = malloc(grid * sizeof *patch->cell_at);
    patch->grid_of = calloc(patch->cell_count, sizeof *patch->grid_of);
    patch->cells = calloc(patch->cell_count, sizeof *patch->cells);
    if (!patch->cell_at || !patch->grid_of || !patch->cells) {
        return -1;
    }
    for (size_t i = 0; i < grid; i++) {
        patch->cell_at[i] = -1;
    }
    for (int tx = 0; tx < tx_count; tx++) {
        for (int rx = 0; rx < rx_count; rx++) {
            if (layout.taxel_at[tx][rx] >= 0) {
                add_taxel_cells(patch, &layout, poses, tx, rx);
            }
        }
    }
    compute_bounding_sphere(patch);
    return 0;
}

/* Add squares of bare sheet, one pitch wide, beside the taxels. They carry load but are not measured. Returns 0, or -1
 * if out of memory. */
int patch_add_margins(struct patch *patch, size_t count, const struct taxel_pose *poses)
{
    patch->margins = malloc((count ? count : 1) * CELLS_PER_TAXEL * sizeof *patch->margins);
    if (!patch->margins) {
        return -1;
    }
    patch->margin_count = count;
    patch->bound += count ? 1.5 * TAXEL_PITCH_M : 0.0;
    for (size_t square = 0; square < count; square++) {
        double left[3];
        cross(poses[square].normal, poses[square].distal, left);
        for (int i = 0; i < CELLS_PER_TAXEL; i++) {
            const int row = i / CELLS_PER_SIDE, column = i % CELLS_PER_SIDE;
            const double a = (0.5 * (CELLS_PER_SIDE - 1) - row) * CELL_SIDE_M;
            const double b = (0.5 * (CELLS_PER_SIDE - 1) - column) * CELL_SIDE_M;
            place_cell(&patch->margins[square * CELLS_PER_TAXEL + (size_t)i], &poses[square], left, a, b, 0.0, 0.0);
        }
    }
    return 0;
}

/* Releases the cells of the skin of one board and clears the struct. */
void patch_free(struct patch *patch)
{
    free(patch->margins);
    free(patch->cell_at);
    free(patch->grid_of);
    free(patch->cells);
    memset(patch, 0, sizeof *patch);
}
