#include "emulator/geometry/patch.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/geometry/vector.h"

/* Arrangement of a board's taxels on the unrolled sheet. */
struct layout {
    int rows, columns;
    int taxel_at[TAXEL_LINES_MAX][TAXEL_LINES_MAX]; /* by place on the unrolled sheet; -1: no taxel */
};

/* Number the taxels in the order of the crossing map (one bit per crossing, by TX line). The firmware later rejects a
 * map whose taxel count differs from `taxels`; until then the map must not cause invalid accesses. */
static void read_layout(struct layout *layout, uint8_t tx_count, uint8_t rx_count, const uint8_t *map, size_t taxels)
{
    int taxel = 0;
    layout->rows = tx_count;
    layout->columns = rx_count;
    for (int tx = 0; tx < tx_count; tx++) {
        for (int rx = 0; rx < rx_count; rx++) {
            const int crossing = tx * rx_count + rx;
            const bool has_taxel = (map[crossing >> 3] >> (crossing & 7)) & 1;
            layout->taxel_at[tx][rx] = has_taxel && taxel < (int)taxels ? taxel++ : -1;
        }
    }
}

/* Write a layout in which each taxel lies at the row and column that its pose states. In the layout of read_layout(),
 * each taxel lies at its TX line (row) and its RX line (column) instead. */
static void read_places(struct layout *layout, size_t taxels, const struct taxel_pose *poses)
{
    *layout = (struct layout){0, 0, {{0}}};
    for (int row = 0; row < (int)TAXEL_LINES_MAX; row++) {
        for (int column = 0; column < (int)TAXEL_LINES_MAX; column++) {
            layout->taxel_at[row][column] = -1;
        }
    }
    for (size_t i = 0; i < taxels; i++) {
        layout->taxel_at[poses[i].row][poses[i].column] = (int)i;
        layout->rows = poses[i].row >= layout->rows ? poses[i].row + 1 : layout->rows;
        layout->columns = poses[i].column >= layout->columns ? poses[i].column + 1 : layout->columns;
    }
}

/* Write taxel poses on a flat sheet, for worlds without taxel poses: x points to the fingertip (distal), y to the left;
 * neighbouring lines are one pitch apart. */
static void place_flat(const struct layout *layout, struct taxel_pose *poses)
{
    for (int tx = 0; tx < layout->rows; tx++) {
        for (int rx = 0; rx < layout->columns; rx++) {
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

/* Return the pose of the taxel at a place of the unrolled sheet; NULL if the place lies outside the sheet or has no
 * taxel. */
static const struct taxel_pose *find_neighbour(const struct layout *layout, const struct taxel_pose *poses, int row,
                                               int column)
{
    if (row < 0 || column < 0 || row >= layout->rows || column >= layout->columns ||
        layout->taxel_at[row][column] < 0) {
        return NULL;
    }
    return &poses[layout->taxel_at[row][column]];
}

/* Return the length (metres) of a side of the square of a taxel or margin; one pitch if no size is stated. axis 0:
 * along the distal direction, 1: across it. */
static double compute_side_length(const struct taxel_pose *pose, int axis)
{
    return pose->size[axis] > 0.0 ? pose->size[axis] : TAXEL_PITCH_M;
}

/* Compute the mean distance between neighbouring cells along rows and columns of the grid: from the distances of
 * neighbouring taxels if the poses state places, otherwise from the pitch. */
static void compute_grid_steps(struct patch *patch, const struct layout *layout, const struct taxel_pose *poses)
{
    patch->step[0] = patch->step[1] = CELL_SIDE_M;
    for (int axis = 0; axis < 2; axis++) {
        double sum = 0.0;
        int count = 0;
        for (size_t i = 0; i < patch->taxel_count && poses[0].has_place; i++) {
            const struct taxel_pose *next =
                find_neighbour(layout, poses, poses[i].row + (axis == 0), poses[i].column + (axis == 1));
            if (next) {
                double square = 0.0;
                for (int k = 0; k < 3; k++) {
                    square += (next->position[k] - poses[i].position[k]) * (next->position[k] - poses[i].position[k]);
                }
                sum += sqrt(square);
                count++;
            }
        }
        if (count) {
            patch->step[axis] = sum / count / CELLS_PER_SIDE;
        }
    }
}

/* Return an upper bound (metres) of the distance between two cells of a square, also on a curved sheet: the diagonal of
 * the square with a reserve. The diagonal of a taxel without a stated size is 1.41 pitches. */
static double compute_square_bound(const struct taxel_pose *pose)
{
    const double diagonal = hypot(compute_side_length(pose, 0), compute_side_length(pose, 1));
    return pose->size[0] > 0.0 ? 1.1 * diagonal : 1.5 * TAXEL_PITCH_M;
}

/* Return the curvature of the sheet at a taxel (1/m): change of the normal per metre in the direction `along`, as the
 * mean over the neighbours on both sides; 0 without neighbours. */
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
            if (fabs(distance) > 0.2 * TAXEL_PITCH_M) { /* a shorter distance would amplify errors of the normals */
                sum += dot(normal_change, along) / distance;
                count++;
            }
        }
    }
    return count ? sum / count : 0.0;
}

/* Set the half sides of a placed cell in the plane tangential to the sheet, and its area. The first half side is the
 * projection of the taxel's distal direction. sides: lengths, metres. */
static void set_sides(struct cell *cell, const double distal[3], const double sides[2])
{
    const double *n = cell->normal, along = dot(distal, n);
    double first[3], second[3];
    for (int k = 0; k < 3; k++) {
        first[k] = distal[k] - along * n[k];
    }
    const double length = sqrt(dot(first, first));
    cross(n, first, second);
    for (int k = 0; k < 3; k++) {
        cell->half[0][k] = 0.5 * sides[0] / length * first[k];
        cell->half[1][k] = 0.5 * sides[1] / length * second[k];
    }
    cell->area = sides[0] * sides[1];
}

/* Place a cell (a sixteenth of a taxel) on the curved sheet, `a` metres from the taxel in its distal direction and `b`
 * metres in its left direction. The sheet is the paraboloid with the curvatures bend[0] (distal) and bend[1] (left),
 * 1/m. sides: lengths of the cell's sides, metres. */
static void place_cell(struct cell *cell, const struct taxel_pose *pose, const double sides[2], double a, double b,
                       const double bend[2])
{
    const double depth = 0.5 * (bend[0] * a * a + bend[1] * b * b);
    double length = 0.0, left[3];
    cross(pose->normal, pose->distal, left);
    for (int k = 0; k < 3; k++) {
        cell->position[k] = pose->position[k] + a * pose->distal[k] + b * left[k] - depth * pose->normal[k];
        cell->normal[k] = pose->normal[k] + bend[0] * a * pose->distal[k] + bend[1] * b * left[k];
        length += cell->normal[k] * cell->normal[k];
    }
    for (int k = 0; k < 3; k++) {
        cell->normal[k] /= sqrt(length);
    }
    set_sides(cell, pose->distal, sides);
}

/* Place the 4 x 4 cells of one taxel on a paraboloid through the taxel whose curvatures follow from the normals of the
 * neighbouring taxels, and enter them in the grid of the unrolled sheet. */
static void add_taxel_cells(struct patch *patch, const struct layout *layout, const struct taxel_pose *poses, int row,
                            int column)
{
    const int taxel = layout->taxel_at[row][column];
    const struct taxel_pose *pose = &poses[taxel];
    const struct taxel_pose *const along_column[2] = {find_neighbour(layout, poses, row - 1, column),
                                                      find_neighbour(layout, poses, row + 1, column)};
    const struct taxel_pose *const along_row[2] = {find_neighbour(layout, poses, row, column - 1),
                                                   find_neighbour(layout, poses, row, column + 1)};
    const double sides[2] = {compute_side_length(pose, 0) / CELLS_PER_SIDE,
                             compute_side_length(pose, 1) / CELLS_PER_SIDE};
    double left[3];
    cross(pose->normal, pose->distal, left);
    const double bend[2] = {compute_curvature(pose, along_column, pose->distal),
                            compute_curvature(pose, along_row, left)};
    for (int i = 0; i < CELLS_PER_TAXEL; i++) {
        const int down = i / CELLS_PER_SIDE, across = i % CELLS_PER_SIDE;
        const int index = taxel * CELLS_PER_TAXEL + i;
        const int grid = (row * CELLS_PER_SIDE + down) * patch->grid_columns + column * CELLS_PER_SIDE + across;
        const double a = (0.5 * (CELLS_PER_SIDE - 1) - down) * sides[0]; /* row 0 is distal, column 0 is left */
        const double b = (0.5 * (CELLS_PER_SIDE - 1) - across) * sides[1];
        place_cell(&patch->cells[index], pose, sides, a, b, bend);
        patch->cell_at[grid] = (int16_t)index;
        patch->grid_of[index] = grid;
    }
}

/* Enlarge the bounding sphere of a patch, whose centre is kept, until the sphere contains a cell. */
static void include_cell(struct patch *patch, const struct cell *cell)
{
    double square = 0.0;
    for (int k = 0; k < 3; k++) {
        const double d = cell->position[k] - patch->centre[k];
        square += d * d;
    }
    const double half = sqrt(dot(cell->half[0], cell->half[0]) + dot(cell->half[1], cell->half[1]));
    patch->bound = fmax(patch->bound, sqrt(square) + half);
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
        include_cell(patch, &patch->cells[i]);
    }
}

/* Build the cells of a board (16 per taxel) from its crossing map, which states the crossings of TX and RX lines that
 * are taxels, and the poses of its taxels (NULL: flat sheet). Returns 0, or -1 if out of memory. */
int patch_init(struct patch *patch, uint8_t tx_count, uint8_t rx_count, const uint8_t *crossing_map, size_t taxel_count,
               const struct taxel_pose *poses)
{
    struct layout layout;
    struct taxel_pose flat[TAXEL_LINES_MAX * TAXEL_LINES_MAX];
    read_layout(&layout, tx_count, rx_count, crossing_map, taxel_count);
    if (!poses) {
        memset(flat, 0, sizeof flat);
        place_flat(&layout, flat);
        poses = flat;
    } else if (poses[0].has_place) {
        read_places(&layout, taxel_count, poses);
    }
    patch->margin_count = 0;
    patch->margins = NULL;
    patch->taxel_count = taxel_count;
    patch->cell_count = taxel_count * CELLS_PER_TAXEL;
    patch->grid_rows = layout.rows * CELLS_PER_SIDE;
    patch->grid_columns = layout.columns * CELLS_PER_SIDE;
    compute_grid_steps(patch, &layout, poses);
    patch->reach = 0.0;
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
    for (int row = 0; row < layout.rows; row++) {
        for (int column = 0; column < layout.columns; column++) {
            if (layout.taxel_at[row][column] >= 0) {
                add_taxel_cells(patch, &layout, poses, row, column);
                patch->reach = fmax(patch->reach, compute_square_bound(&poses[layout.taxel_at[row][column]]));
            }
        }
    }
    compute_bounding_sphere(patch);
    return 0;
}

/* Add rectangles of bare sheet beside the taxels, which carry load but are not measured. poses: centre, axes and sides
 * of each of the `count` rectangles. Returns 0, or -1 if out of memory. */
int patch_add_margins(struct patch *patch, size_t count, const struct taxel_pose *poses)
{
    patch->margins = malloc((count ? count : 1) * CELLS_PER_TAXEL * sizeof *patch->margins);
    if (!patch->margins) {
        return -1;
    }
    patch->margin_count = count;
    patch->bound += count ? 1.5 * TAXEL_PITCH_M : 0.0; /* usual margins: strips of one pitch beside the taxels */
    for (size_t square = 0; square < count; square++) {
        const double sides[2] = {compute_side_length(&poses[square], 0) / CELLS_PER_SIDE,
                                 compute_side_length(&poses[square], 1) / CELLS_PER_SIDE};
        const double flat[2] = {0.0, 0.0};
        patch->reach = fmax(patch->reach, compute_square_bound(&poses[square]));
        for (int i = 0; i < CELLS_PER_TAXEL; i++) {
            const int row = i / CELLS_PER_SIDE, column = i % CELLS_PER_SIDE;
            const double a = (0.5 * (CELLS_PER_SIDE - 1) - row) * sides[0];
            const double b = (0.5 * (CELLS_PER_SIDE - 1) - column) * sides[1];
            struct cell *cell = &patch->margins[square * CELLS_PER_TAXEL + (size_t)i];
            place_cell(cell, &poses[square], sides, a, b, flat);
            include_cell(patch, cell);
        }
    }
    return 0;
}

/* Free the cells of the skin of one board and clear the struct. */
void patch_free(struct patch *patch)
{
    free(patch->margins);
    free(patch->cell_at);
    free(patch->grid_of);
    free(patch->cells);
    memset(patch, 0, sizeof *patch);
}
