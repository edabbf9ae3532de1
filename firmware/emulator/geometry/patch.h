/* Skin of one board, divided into 4 x 4 cells per taxel, finer than the resolution of any measurement.
 *
 * The cells follow the curvature of the sheet, computed from the normals of neighbouring taxels. They also lie on a
 * grid of the unrolled sheet (4 rows per TX line, 4 columns per RX line), on which effects spread between cells. */
#ifndef EMULATOR_GEOMETRY_PATCH_H
#define EMULATOR_GEOMETRY_PATCH_H

#include <stddef.h>
#include <stdint.h>

#include "emulator/geometry/frame.h"
#include "emulator/geometry/shape.h"
#include "generated/taxel_protocol.h"

#define CELLS_PER_SIDE 4
#define CELLS_PER_TAXEL (CELLS_PER_SIDE * CELLS_PER_SIDE)
#define TAXEL_PITCH_M 0.005
#define CELL_SIDE_M (TAXEL_PITCH_M / CELLS_PER_SIDE)
#define SKIN_CELL_AREA_M2 (CELL_SIDE_M * CELL_SIDE_M)

/* Pose of a taxel in its bracket's frame: centre of the electrode, outward normal, direction of its distal side. */
struct taxel_pose {
    double position[3], normal[3], distal[3];
};

struct cell {
    double position[3], normal[3]; /* of the electrode surface below the cell, bracket frame */
};

struct patch {
    size_t taxel_count, cell_count;
    int grid_rows, grid_columns;
    int16_t *cell_at;   /* [grid_rows][grid_columns]: index of a cell, or -1 without a taxel */
    int32_t *grid_of;   /* [cell_count]: position of a cell on the grid */
    struct cell *cells; /* [taxel_count][16] */
    size_t margin_count;
    struct cell *margins;    /* [margin_count][16] of bare sheet beside the taxels: carries load but is not measured */
    double centre[3], bound; /* bounding sphere of the cells, metres */
};

/* Initialise a patch. Returns 0, or -1 if out of memory. poses: in the order of the crossing map; NULL: a flat sheet.
 */
int patch_init(struct patch *patch, uint8_t tx_count, uint8_t rx_count, const uint8_t *crossing_map, size_t taxel_count,
               const struct taxel_pose *poses);

/* Add flat squares of bare sheet, each one pitch wide. Returns 0, or -1 if out of memory. */
int patch_add_margins(struct patch *patch, size_t count, const struct taxel_pose *poses);
void patch_free(struct patch *patch);

#endif
