/* Expected answers of a board, byte by byte: an independent implementation of SPEC.md, part 1. It copies snapshots
 * where the firmware changes the roles of buffers, and does not use the firmware's structs. */
#ifndef TAXEL_BOARD_MODEL_H
#define TAXEL_BOARD_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define MODEL_TAXELS_MAX 240u
#define MODEL_SNAPSHOT_MAX (10u + 2u * MODEL_TAXELS_MAX)
#define MODEL_WRITE_MAX 12u
#define MODEL_SETTINGS_SIZE 8u

struct model_snapshot {
    bool exists;
    uint8_t bytes[MODEL_SNAPSHOT_MAX];
};

struct board_model {
    /* the board */
    uint8_t address, reset_cause, rows, columns;
    uint16_t taxel_count;
    uint8_t crossing_map[32];
    uint8_t boot_settings[MODEL_SETTINGS_SIZE];
    uint8_t identity[58];

    /* the scan */
    bool scanning, converting;
    bool dropped_conversion; /* the running conversion began before a stop: its raw count is discarded */
    uint16_t taxel;          /* index of the taxel being converted */
    uint8_t settings[MODEL_SETTINGS_SIZE], next_settings[MODEL_SETTINGS_SIZE];
    bool settings_pending;
    uint8_t settings_generation;
    uint32_t clock_us, started_us, scan_time_us, scans;
    struct model_snapshot being_scanned, newest, latched;
    unsigned conversions_started;
    unsigned front_end_configurations; /* number of times that the front end received settings, including the boot */

    /* the registers */
    uint8_t pointer, error_flags;
    bool pointer_next; /* the next byte written is the register pointer */
    bool refused;      /* the write was too long: all further bytes are not acknowledged */
    uint8_t written[MODEL_WRITE_MAX];
    size_t written_size;
    uint32_t snapshot_reads;
    uint16_t bus_errors, rejected_writes, saturated_conversions;
    uint8_t answer[MODEL_SNAPSHOT_MAX];
    size_t answer_size, answer_position;

    bool restart_requested, bootloader_requested;
};

/* Reset the model. It keeps address, reset_cause, rows, columns, taxel_count, crossing_map, boot_settings and the
 * clock. */
void model_boot(struct board_model *model, const uint8_t version[3], uint8_t kind, const uint8_t unique_id[8]);
bool model_settings_are_valid(const uint8_t settings[MODEL_SETTINGS_SIZE]);

void model_start(struct board_model *model);
void model_conversion(struct board_model *model, uint16_t raw_count);
/* Return the crossing, TX * columns + RX, of the conversion that must be in progress; 0xFFFF if there is none. */
uint16_t model_crossing(const struct board_model *model);

bool model_address(struct board_model *model, bool reading);
bool model_write(struct board_model *model, uint8_t byte);
uint8_t model_read(struct board_model *model);
void model_stop(struct board_model *model);
void model_bus_error(struct board_model *model);

#endif
