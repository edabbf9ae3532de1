/* Skin of one board, divided into 4 x 4 cells per taxel, finer than the resolution of any measurement.
 *
 * The cells follow the curvature of the sheet, computed from the normals of neighbouring taxels. They also lie on a
 * grid of the unrolled sheet (4 rows and 4 columns per taxel), on which effects spread between cells. A taxel lies at
 * the place that its pose states, otherwise at its TX line (row) and RX line (column). A square is the rectangle of 4 x
 * 4 cells above one taxel or of one margin (bare sheet beside the taxels). */
#ifndef EMULATOR_GEOMETRY_PATCH_H
#define EMULATOR_GEOMETRY_PATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/geometry/frame.h"
#include "emulator/geometry/shape.h"
#include "generated/taxel_protocol.h"

#define CELLS_PER_SIDE 4
#define CELLS_PER_TAXEL (CELLS_PER_SIDE * CELLS_PER_SIDE)
#define TAXEL_PITCH_M 0.005
#define CELL_SIDE_M (TAXEL_PITCH_M / CELLS_PER_SIDE)

/* Pose of a taxel in its bracket's frame: centre of the electrode, outward normal, direction of its distal side. */
struct taxel_pose {
    double position[3], normal[3], distal[3];
    double size[2];  /* sides of the measured square along the distal direction and across it, metres; 0: one pitch */
    bool has_place;  /* whether row and column are stated */
    int row, column; /* place on the unrolled sheet, 0 to TAXEL_LINES_MAX - 1 */
};

/* One of the 4 x 4 cells of a taxel or margin. */
struct cell {
    double position[3], normal[3]; /* of the electrode surface below the cell, bracket frame */
    double half[2][3];             /* half of each side of the cell: distal, left; metres */
    double area;                   /* square metres */
};

/* Skin of one board as cells, and their grid on the unrolled sheet. */
struct patch {
    size_t taxel_count, cell_count;
    int grid_rows, grid_columns;
    double step[2];     /* mean distance between neighbouring cells of the grid along rows and columns, metres */
    double reach;       /* bound of the distance between two points of a square, metres */
    int16_t *cell_at;   /* [grid_rows][grid_columns]: index of a cell, or -1 without a taxel */
    int32_t *grid_of;   /* [cell_count]: position of a cell on the grid */
    struct cell *cells; /* [taxel_count][16] */
    size_t margin_count;
    struct cell *margins;    /* [margin_count][16] of bare sheet beside the taxels: carries load but is not measured */
    double centre[3], bound; /* bounding sphere of the cells: centre and radius, metres */
};

/* Build the cells of a board. Returns 0, or -1 if out of memory. poses: of the taxels in the order of the crossing map,
 * all at different places; NULL: a flat sheet. */
int patch_init(struct patch *patch, uint8_t tx_count, uint8_t rx_count, const uint8_t *crossing_map, size_t taxel_count,
               const struct taxel_pose *poses);

/* Add `count` margins, flat rectangles of bare sheet (size 0: one taxel pitch), that carry load but are not measured.
 * Returns 0, or -1 if out of memory. */
int patch_add_margins(struct patch *patch, size_t count, const struct taxel_pose *poses);
void patch_free(struct patch *patch);

#endif
