/* The description of one board of an emulated world, as the world file states it. */
#ifndef EMULATOR_GEOMETRY_BOARD_DESCRIPTION_H
#define EMULATOR_GEOMETRY_BOARD_DESCRIPTION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/geometry/frame.h"
#include "emulator/geometry/patch.h"
#include "generated/taxel_protocol.h"

struct psoc_part; /* psoc4/parts.h */

#define WORLD_BOARDS_MAX 64
#define WORLD_IMAGE_SIZE 65536u /* the largest part */
#define WORLD_MARGINS_MAX 512

/* One board of an emulated world. `kind`, `rows` (TX lines), `columns` (RX lines) and the crossing map describe the
 * electrodes as in the identity that the board reports. */
struct board_description {
    uint8_t address;
    uint8_t kind;
    uint8_t rows;
    uint8_t columns;
    uint16_t taxel_count;
    uint8_t crossing_map[TAXEL_CROSSING_MAP_SIZE];
    uint8_t unique_id[8];
    uint8_t map_version_override; /* reported in the identity instead of the firmware's own; 0: not overridden */
    uint8_t firmware_version[3];
    double clock_ppm;
    double clock_start_us; /* the board's clock after boot */
    double boot_ms;
    uint8_t *image; /* [WORLD_IMAGE_SIZE] flash of a board that executes an image; NULL: natively compiled firmware */
    const struct psoc_part *part;   /* of a board that executes an image; NULL: the standard part */
    bool is_blank;                  /* without application and configuration, as after assembly */
    size_t taxel_pose_count;        /* 0 or taxel_count */
    struct taxel_pose *taxel_poses; /* [taxel_pose_count] */
    size_t margin_count;
    /* [margin_count] poses of margins: squares of bare sheet beside the taxels, which bear load but are not measured */
    struct taxel_pose *margin_poses;
    struct frame bracket_offset; /* pose of the mounted bracket relative to its nominal pose */
};

#endif
