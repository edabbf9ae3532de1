/* The description of an emulated world, and its reader. A world file has one `keyword value...` per line; `#` starts a
 * comment. README.md lists the keywords. */
#ifndef EMULATOR_WORLD_FILE_WORLD_FILE_H
#define EMULATOR_WORLD_FILE_WORLD_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/geometry/board_description.h"
#include "emulator/effects/effects.h"
#include "emulator/base/faults.h"
#include "emulator/geometry/frame.h"
#include "emulator/geometry/shape.h"
#include "emulator/original/original_settings.h"
#include "emulator/wiring/wiring.h"
#include "generated/taxel_protocol.h"

#define WORLD_FIRMWARE_VERSION {0, 1, 0} /* of the hub, and of boards without a `firmware` line */
#define WORLD_FAULTS_MAX 4096
#define WORLD_OBJECTS_MAX 16

struct object_description {
    struct shape shape;
    struct frame offset; /* actual pose of the object relative to its nominal pose */
};

struct world_description {
    uint64_t seed;
    uint64_t parts_seed; /* of differences between parts that persist over power-ups */
    bool has_parts_seed; /* otherwise parts_seed equals seed */
    double scl_hz;
    double baud;
    double usb_latency_ms;
    double usb_latency_down_ms;
    bool flow_control; /* the hub's RTS is wired to the USB adapter */
    double hub_clock_ppm;
    double hub_clock_start_us;
    double hub_byte_us;               /* how long a native hub holds SCL low after each byte */
    uint8_t *hub_image;               /* like board_description.image */
    const struct psoc_part *hub_part; /* of a hub that executes an image; NULL: the standard part */
    double noise_counts;
    bool boot_listens; /* bootloaders wait 100 ms for a host after power-up, like those in silicon */
    struct taxel_scan_settings scan;
    struct original_settings original; /* the original hub and boards in place of the project's own firmware */
    struct board_description boards[WORLD_BOARDS_MAX];
    size_t board_count;
    struct wiring_description wiring;
    double layer_thickness;             /* above the electrodes, metres */
    struct object_description *objects; /* [object_count] */
    size_t object_count;
    struct effects effects;
    struct fault_description faults[WORLD_FAULTS_MAX];
    size_t fault_count;
};

/* Read a world file. Returns 0, or -1 after one line on stderr that names the file, the line and the error. Call
 * world_file_free() in both cases. */
int world_file_read(struct world_description *world, const char *path);
void world_file_free(struct world_description *world);

#endif
