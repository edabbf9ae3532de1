/* One board's piece of skin, cut into 4 x 4 cells a taxel: finer than anything that is measured.
 *
 * Cells follow the sheet's curvature, which is read off the normals of neighbouring taxels. They also lie on a grid of the
 * unrolled sheet (4 rows a TX line, 4 columns an RX line), on which effects spread from cell to cell. */
#ifndef EMULATOR_SKIN_PATCH_H
#define EMULATOR_SKIN_PATCH_H

#include <stddef.h>
#include <stdint.h>

#include "emulator/skin/frame.h"
#include "emulator/skin/shape.h"
#include "generated/taxel_protocol.h"

#define CELLS_PER_SIDE 4
#define CELLS_PER_TAXEL (CELLS_PER_SIDE * CELLS_PER_SIDE)
#define TAXEL_PITCH_M 0.005
#define CELL_SIDE_M (TAXEL_PITCH_M / CELLS_PER_SIDE)
#define SKIN_CELL_AREA_M2 (CELL_SIDE_M * CELL_SIDE_M)

/* A taxel's place in its bracket's frame: centre of the electrode, outward normal, direction of its distal side. */
struct taxel_place {
    double position[3], normal[3], distal[3];
};

struct cell {
    double position[3], normal[3]; /* of the electrode's surface below it, bracket frame */
};

struct patch {
    size_t taxel_count, cell_count;
    int grid_rows, grid_columns;
    int16_t *cell_at;  /* [grid_rows][grid_columns]: a cell, or -1 where the sheet has no taxel */
    int32_t *grid_of;  /* [cell_count]: where a cell lies on that grid */
    struct cell *cells; /* [taxel_count][16] */
    size_t margin_count;
    struct cell *margins;    /* [margin_count][16] of bare sheet beside the taxels: they bear load, nothing measures it */
    double centre[3], bound; /* a ball that holds the cells, metres */
};

/* Returns 0, or -1 without memory. `places` in the order of the crossing map, as the taxels of the board; NULL: a flat sheet. */
int patch_init(struct patch *patch, uint8_t tx_count, uint8_t rx_count, const uint8_t *crossing_map, size_t taxel_count,
               const struct taxel_place *places);

/* Add squares of bare sheet, one pitch wide each, flat. Returns 0, or -1 without memory. */
int patch_add_margins(struct patch *patch, size_t count, const struct taxel_place *places);
void patch_free(struct patch *patch);

#endif
