/* Cells of a board: positions and neighbours. */
#include <math.h>

#include "check.h"
#include "emulator/geometry/patch.h"

#define ROWS 3
#define COLUMNS 5
#define RADIUS_M 0.014

static const uint8_t full_map[TAXEL_CROSSING_MAP_SIZE] = {0xFF, 0x7F};
static const uint8_t holed_map[TAXEL_CROSSING_MAP_SIZE] = {0x7F, 0x7F}; /* without TX 1, RX 2 */

/* Return the distance of two points in metres. */
static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

static void the_cells_of_a_flat_sheet_form_a_regular_grid(void)
{
    struct patch patch;
    CHECK_EQUAL(patch_init(&patch, ROWS, COLUMNS, full_map, 15, NULL), 0);
    CHECK_EQUAL(patch.cell_count, 15 * CELLS_PER_TAXEL);
    CHECK(fabs(patch.cells[0].area * CELLS_PER_TAXEL - TAXEL_PITCH_M * TAXEL_PITCH_M) < 1e-18);
    for (int row = 0; row < patch.grid_rows; row++) {
        for (int column = 0; column < patch.grid_columns; column++) {
            const int cell = patch.cell_at[row * patch.grid_columns + column];
            CHECK(cell >= 0 && patch.grid_of[cell] == row * patch.grid_columns + column);
            const double *p = patch.cells[cell].position;
            CHECK(fabs(p[0] - (1.5 - row) * CELL_SIDE_M) < 1e-12);
            CHECK(fabs(p[1] - (1.5 - column) * CELL_SIDE_M) < 1e-12);
            CHECK(p[2] == 0.0 && patch.cells[cell].normal[2] == 1.0);
        }
    }
    patch_free(&patch);
}

static void a_crossing_without_a_taxel_is_a_hole(void)
{
    struct patch patch;
    unsigned holes = 0;
    CHECK_EQUAL(patch_init(&patch, ROWS, COLUMNS, holed_map, 14, NULL), 0);
    for (int i = 0; i < patch.grid_rows * patch.grid_columns; i++) {
        const int row = i / patch.grid_columns, column = i % patch.grid_columns;
        const bool hole = row / CELLS_PER_SIDE == 1 && column / CELLS_PER_SIDE == 2;
        CHECK((patch.cell_at[i] < 0) == hole);
        holes += patch.cell_at[i] < 0;
    }
    CHECK_EQUAL(holes, CELLS_PER_TAXEL);
    patch_free(&patch);
}

/* Set taxel poses on a cylinder: the TX lines follow each other along the axis (x), the RX lines around it. Left is the
 * direction of increasing angle. */
static void set_poses_on_cylinder(struct taxel_pose *poses)
{
    for (int i = 0; i < ROWS * COLUMNS; i++) {
        const double angle = -TAXEL_PITCH_M / RADIUS_M * (i % COLUMNS);
        poses[i] = (struct taxel_pose){
            .position = {-TAXEL_PITCH_M * (i / COLUMNS), RADIUS_M * sin(angle), RADIUS_M * cos(angle)},
            .normal = {0.0, sin(angle), cos(angle)},
            .distal = {1.0, 0.0, 0.0},
        };
    }
}

static void cells_follow_a_cylinder(void)
{
    struct taxel_pose poses[ROWS * COLUMNS];
    struct patch patch;
    set_poses_on_cylinder(poses);
    CHECK_EQUAL(patch_init(&patch, ROWS, COLUMNS, full_map, 15, poses), 0);
    for (size_t i = 0; i < patch.cell_count; i++) {
        const double *p = patch.cells[i].position, *n = patch.cells[i].normal;
        const double radius = hypot(p[1], p[2]);
        CHECK_BETWEEN(radius - RADIUS_M, -20e-6, 20e-6);
        CHECK((n[1] * p[1] + n[2] * p[2]) / radius > cos(0.02)); /* within 0.02 rad of the radius */
        CHECK(fabs(n[0]) < 1e-12);
    }
    for (int i = 0; i + 1 < patch.grid_columns; i++) { /* neighbours are one cell apart, also across taxels */
        const double spacing =
            distance(patch.cells[patch.cell_at[i]].position, patch.cells[patch.cell_at[i + 1]].position);
        CHECK_BETWEEN(spacing / CELL_SIDE_M, 0.93, 1.07);
    }
    patch_free(&patch);
}

/* Two columns of three taxels, described in another order than that of their places. Their rectangles have 4 x 6 mm and
 * a pitch of 5 mm (rows) and 8 mm (columns). */
static void taxels_lie_at_their_stated_places(void)
{
    const uint8_t map[TAXEL_CROSSING_MAP_SIZE] = {0x3F};
    struct taxel_pose poses[6];
    struct patch patch;
    for (int i = 0; i < 6; i++) {
        poses[i] = (struct taxel_pose){
            .position = {-0.005 * (i % 3), -0.008 * (i / 3), 0.0},
            .normal = {0.0, 0.0, 1.0},
            .distal = {1.0, 0.0, 0.0},
            .size = {0.004, 0.006},
            .has_place = true,
            .row = i % 3,
            .column = i / 3,
        };
    }
    CHECK_EQUAL(patch_init(&patch, 2, 3, map, 6, poses), 0);
    CHECK_EQUAL(patch.grid_rows, 3 * CELLS_PER_SIDE);
    CHECK_EQUAL(patch.grid_columns, 2 * CELLS_PER_SIDE);
    CHECK(fabs(patch.step[0] - 0.005 / CELLS_PER_SIDE) < 1e-12);
    CHECK(fabs(patch.step[1] - 0.008 / CELLS_PER_SIDE) < 1e-12);
    for (size_t i = 0; i < patch.cell_count; i++) {
        CHECK(fabs(patch.cells[i].area - 0.004 * 0.006 / CELLS_PER_TAXEL) < 1e-15);
    }
    CHECK_EQUAL(patch.cell_at[0], 0);
    CHECK_EQUAL(patch.cell_at[CELLS_PER_SIDE], 3 * CELLS_PER_TAXEL); /* taxel 3 is the first of the second column */
    CHECK(fabs(patch.cells[0].position[0] - 0.0015) < 1e-12);
    CHECK(fabs(patch.cells[0].position[1] - 0.00225) < 1e-12);
    CHECK(patch.reach >= distance(patch.cells[0].position, patch.cells[CELLS_PER_TAXEL - 1].position));
    patch_free(&patch);
}

static void the_bounding_sphere_contains_every_cell(void)
{
    struct taxel_pose poses[ROWS * COLUMNS];
    struct patch patch;
    set_poses_on_cylinder(poses);
    CHECK_EQUAL(patch_init(&patch, ROWS, COLUMNS, full_map, 15, poses), 0);
    for (size_t i = 0; i < patch.cell_count; i++) {
        CHECK(distance(patch.cells[i].position, patch.centre) <= patch.bound);
    }
    patch_free(&patch);
}

int main(void)
{
    RUN(the_cells_of_a_flat_sheet_form_a_regular_grid);
    RUN(a_crossing_without_a_taxel_is_a_hole);
    RUN(cells_follow_a_cylinder);
    RUN(taxels_lie_at_their_stated_places);
    RUN(the_bounding_sphere_contains_every_cell);
    return check_summary();
}
