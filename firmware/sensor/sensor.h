/* A sensor board: scans its crossings for ever, keeps coherent snapshots, and answers on I2C as a set of registers.
 *
 *   conversion interrupt -> taxel_sensor_on_conversion()        scan.c: next crossing, or a snapshot is complete
 *   I2C interrupt        -> taxel_sensor_on_address() ...       slave.c: register machine
 *   main loop            -> taxel_sensor_run()                  compact.c: the newest snapshot in fewer bytes
 *
 * Three snapshot buffers change roles and are never copied: one is being scanned into, one is the newest complete, one is
 * latched by the reader. A reader therefore never sees half of a scan, and the scan never waits for a reader. */
#ifndef TAXEL_SENSOR_H
#define TAXEL_SENSOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"
#include "hal/sensor_hal.h"
#include "sensor/compact.h"

#define TAXEL_SNAPSHOT_SIZE(taxels) (TAXEL_SNAPSHOT_OVERHEAD + 2u * (taxels))

enum taxel_sensor_state {
    TAXEL_SENSOR_STOPPED = 0,
    TAXEL_SENSOR_SCANNING = 1,
};

enum taxel_error {
    TAXEL_ERROR_INVALID = -22, /* a configuration or an argument out of range */
};

struct taxel_sensor_config {
    const struct taxel_sensor_hal *hal;
    uint8_t address;
    uint8_t kind;
    uint8_t reset_cause;
    uint8_t firmware_version[3];
    uint8_t unique_id[8];
    uint8_t rows;    /* TX lines */
    uint8_t columns; /* RX lines */
    uint16_t taxel_count;
    const uint8_t *crossing_map; /* TAXEL_CROSSING_MAP_SIZE bytes, taxel_count bits set */
    struct taxel_scan_settings settings;
    uint8_t *snapshots[3]; /* TAXEL_SNAPSHOT_SIZE(taxel_count) bytes each */
    struct taxel_compact_memory compact; /* states NULL: no compact snapshots */
};

struct taxel_scan {
    uint8_t *scanning;
    uint8_t *newest;
    uint8_t *latched;
    uint32_t crc;
    uint32_t started_us;
    uint32_t scans;
    uint32_t scan_time_us;
    uint16_t crossing;
    uint16_t taxel;
    uint16_t saturated_conversions;
    uint8_t latches; /* modulo 256 */
    bool has_newest;
    bool has_latched;
    bool settings_pending;
    bool converting;
    bool begin_after_conversion;
};

struct taxel_slave {
    const uint8_t *source;
    size_t source_size;
    size_t source_position;
    uint32_t snapshot_reads;
    uint16_t bus_errors;
    uint16_t rejected_writes;
    uint8_t pointer;
    uint8_t written;
    bool pointer_next;
    bool pointer_written; /* in this transaction, and nothing after it */
    bool refused; /* a byte of this write was not acknowledged: the rest of it is not taken either */
    uint8_t write_bytes[TAXEL_SETTINGS_REGISTER_SIZE];
    uint8_t shadow[TAXEL_STATUS_SIZE]; /* status or settings as of the start of a read */
};

struct taxel_sensor {
    const struct taxel_sensor_config *config;
    struct taxel_scan scan;
    struct taxel_slave slave;
    struct taxel_compact compact;
    struct taxel_scan_settings settings;
    struct taxel_scan_settings next_settings;
    uint8_t identity[TAXEL_IDENTITY_SIZE];
    uint8_t state;
    uint8_t error_flags;
    uint8_t settings_generation;
};

/* Set up from a configuration that stays in place. Returns 0, or TAXEL_ERROR_INVALID if map, sizes or settings are wrong. */
int taxel_sensor_init(struct taxel_sensor *sensor, const struct taxel_sensor_config *config);

/* Scanning (scan.c). */
void taxel_scan_start(struct taxel_sensor *sensor);
void taxel_scan_stop(struct taxel_sensor *sensor);
void taxel_scan_latch(struct taxel_sensor *sensor);
void taxel_sensor_on_conversion(struct taxel_sensor *sensor, uint16_t raw_count);
bool taxel_scan_settings_are_valid(const struct taxel_scan_settings *settings);

/* Compact snapshots (compact.c). Call run() after interrupts, from the main loop; has_work(): it would do something now. */
void taxel_sensor_run(struct taxel_sensor *sensor);
bool taxel_sensor_has_work(const struct taxel_sensor *sensor);

/* I2C slave (slave.c). on_address and on_write return whether to acknowledge. */
bool taxel_sensor_on_address(struct taxel_sensor *sensor, bool reading);
bool taxel_sensor_on_write(struct taxel_sensor *sensor, uint8_t byte);
uint8_t taxel_sensor_on_read(struct taxel_sensor *sensor);
void taxel_sensor_on_stop(struct taxel_sensor *sensor);
void taxel_sensor_on_bus_error(struct taxel_sensor *sensor);

#endif
