/* The description of the world that is emulated: one `word value...` a line, `#` begins a comment. README.md lists the words. */
#ifndef EMULATOR_WORLD_FILE_H
#define EMULATOR_WORLD_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/effects/effects.h"
#include "emulator/faults.h"
#include "emulator/skin/frame.h"
#include "emulator/skin/patch.h"
#include "emulator/skin/shape.h"
#include "generated/taxel_protocol.h"

#define WORLD_BOARDS_MAX 64
#define WORLD_FIRMWARE_VERSION {0, 1, 0} /* of boards about which the file says nothing else, and of the hub */
#define WORLD_FAULTS_MAX 4096
#define WORLD_IMAGE_SIZE 32768u
#define WORLD_OBJECTS_MAX 16
#define WORLD_MARGINS_MAX 512

struct board_description {
    uint8_t address;
    uint8_t kind;
    uint8_t rows;
    uint8_t columns;
    uint16_t taxel_count;
    uint8_t crossing_map[TAXEL_CROSSING_MAP_SIZE];
    uint8_t unique_id[8];
    uint8_t map_version_override; /* 0: the firmware's own; else what the identity claims */
    uint8_t firmware_version[3];
    double clock_ppm;
    double clock_start_us; /* what the board's clock says when it has booted */
    double boot_ms;
    uint8_t *image; /* [WORLD_IMAGE_SIZE] flash of a board whose program is executed; NULL: this program's own firmware runs */
    bool is_blank; /* nothing but the bootloader, as boards come from assembly */
    size_t placed;                   /* taxels whose place is known; all or none */
    struct taxel_place *places;      /* [placed] */
    size_t margin_count;
    struct taxel_place *margins;     /* [margin_count] squares of bare sheet beside the taxels: they bear, unmeasured */
    struct frame bracket_offset;     /* where the bracket truly is, in the frame in which it is believed to be */
};

struct object_description {
    struct shape shape;
    struct frame offset; /* where the object truly is, in the frame in which it is believed to be */
};

struct world_description {
    uint64_t seed;
    uint64_t parts_seed; /* of what differs from part to part, power-up after power-up */
    bool parts_seed_is_given;
    double scl_hz;
    double baud;
    double usb_latency_ms;
    double usb_latency_down_ms;
    bool flow_control; /* the hub's RTS is wired to the adapter */
    double hub_clock_ppm;
    double hub_clock_start_us;
    double hub_byte_us; /* how long a native hub holds SCL after each byte; 0 unless told */
    uint8_t *hub_image; /* as of a board */
    double noise_counts;
    bool boot_listens; /* bootloaders wait 100 ms for a host after power-up, as on silicon */
    struct taxel_scan_settings scan;
    struct board_description boards[WORLD_BOARDS_MAX];
    size_t board_count;
    double layer_thickness; /* over the electrodes, metres */
    struct object_description *objects; /* [object_count] */
    size_t object_count;
    struct effects effects;
    struct fault_description faults[WORLD_FAULTS_MAX];
    size_t fault_count;
};

/* Returns 0, or -1 after one line on stderr that names the file, the line and what is wrong with it. */
int world_file_read(struct world_description *world, const char *path);
void world_file_free(struct world_description *world);

#endif
