/* A sensor board: scans its crossings continuously, keeps coherent snapshots, and is read as a set of I2C registers.
 *
 *   conversion interrupt -> taxel_sensor_on_conversion()        scan.c: next crossing, or the snapshot is complete
 *   I2C interrupt        -> taxel_sensor_on_address() ...       slave.c: register machine
 *   main loop            -> taxel_sensor_run()                  compact.c: the newest snapshot in fewer bytes
 *
 * Three snapshot buffers change roles and are never copied: one receives the current scan, one is the newest
 * complete snapshot, one is latched by the reader. A reader therefore never sees part of a scan, and the scan never
 * waits for a reader.
 *
 * Integration (`hal`: struct taxel_sensor_hal of the port; all memory is the caller's):
 *
 *     static struct taxel_sensor sensor;
 *     static uint8_t snapshots[3][TAXEL_SNAPSHOT_SIZE(4u)];
 *     static const uint8_t crossing_map[TAXEL_CROSSING_MAP_SIZE] = {0x0F};
 *     static const struct taxel_sensor_config config = {
 *         .hal = &hal, .address = 0x20, .rows = 2, .columns = 2, .taxel_count = 4, .crossing_map = crossing_map,
 *         .settings = {.sub_conversions = 100, .sense_clock_divider = 40, .modulator_clock_divider = 1,
 *                      .idac_code = 96},
 *         .snapshots = {snapshots[0], snapshots[1], snapshots[2]},
 *     };
 *     if (taxel_sensor_init(&sensor, &config)) {
 *         return TAXEL_ERROR_INVALID;
 *     }
 *     taxel_scan_start(&sensor);
 *     for (;;) {
 *         if (taxel_scan_check(&sensor) == TAXEL_SCAN_ADVANCED) {
 *             watchdog_feed();
 *         }
 *         taxel_sensor_run(&sensor);
 *         wait_for_interrupt();
 *     }
 *     // interrupt at the end of a conversion:  taxel_sensor_on_conversion(&sensor, raw_count);
 *     // I2C slave interrupt:                   acknowledge = taxel_sensor_on_address(&sensor, reading);
 *     //                                        acknowledge = taxel_sensor_on_write(&sensor, byte);
 *     //                                        byte = taxel_sensor_on_read(&sensor);
 *     //                                        taxel_sensor_on_stop(&sensor);
 *
 * firmware/tests/test_integration_examples.c compiles and runs this example. */
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
    /* Functions of the port. Every pointer is set. */
    const struct taxel_sensor_hal *hal;

    /* 7-bit I2C address, TAXEL_ADDRESS_MIN (0x08) to TAXEL_ADDRESS_MAX (0x77). */
    uint8_t address;

    /* Board design, 0 to 255, as numbered in the hand description. Reported in the identity. */
    uint8_t kind;

    /* enum taxel_reset_cause of the last reset. Reported in the status. */
    uint8_t reset_cause;

    /* enum taxel_front_end: kind of converter, which defines the meaning of the scan settings. Reported in the status. */
    uint8_t front_end;

    /* Major, minor, patch, each 0 to 255. */
    uint8_t firmware_version[3];

    /* Id of the processor, 8 bytes of any value. */
    uint8_t unique_id[8];

    /* Number of TX lines (rows) and RX lines (columns), 1 to TAXEL_LINES_MAX (16) each. */
    uint8_t rows;
    uint8_t columns;

    /* Number of taxels, 1 to TAXEL_TAXELS_MAX (240): the number of bits set in crossing_map. */
    uint16_t taxel_count;

    /* TAXEL_CROSSING_MAP_SIZE (32) bytes. Bit tx * columns + rx, least significant bit first, is 1 for a taxel; bits
     * from rows * columns on are 0. */
    const uint8_t *crossing_map;

    /* Initial scan settings. sub_conversions * sense_clock_divider is the largest raw count, 1 to 65535;
     * modulator_clock_divider (CPU clocks) and idac_code (current code) are 1 to 255; settle_cycles is 0 to 65535
     * CPU clocks. */
    struct taxel_scan_settings settings;

    /* Three buffers of TAXEL_SNAPSHOT_SIZE(taxel_count) bytes each. */
    uint8_t *snapshots[3];

    /* Fault record of the last fault since power-on, TAXEL_FAULT_RECORD_SIZE (12) bytes as in the register. NULL: no
     * fault. */
    const uint8_t *fault_record;

    /* Memory for compact snapshots. states NULL, or more than TAXEL_COMPACT_TAXELS_MAX (238) taxels: the board has
     * none. */
    struct taxel_compact_memory compact;
};

/* Longest time without a conversion in microseconds. The longest conversion takes 65535 * 255 CPU clocks, 0.35 s at
 * 48 MHz; a larger limit reports a stopped converter later, a smaller one reports slow settings. */
#define TAXEL_SCAN_STALL_US 500000u

/* Result of taxel_scan_check(). */
enum taxel_scan_progress {
    TAXEL_SCAN_ADVANCED, /* a conversion has ended since the last call, or the scan is stopped by command */
    TAXEL_SCAN_WAITING,
    TAXEL_SCAN_STALLED, /* no conversion for TAXEL_SCAN_STALL_US: returned once, then TAXEL_SCAN_WAITING */
};

struct taxel_scan {
    uint8_t *scanning;     /* buffer of the scan in progress */
    uint8_t *newest;       /* buffer of the newest complete scan */
    uint8_t *latched;      /* buffer that a reader reads */
    uint32_t crc;          /* of the I2C address and the bytes of `scanning` so far */
    uint32_t started_us;   /* start of the scan in progress */
    uint32_t scans;        /* complete scans; the low 16 bits are the sequence number */
    uint32_t scan_time_us; /* duration of the last complete scan */
    uint32_t checked_us;   /* clock of the last check that found progress */
    uint16_t checked_position;
    uint16_t crossing; /* next crossing of the scan, tx * columns + rx */
    uint16_t taxel;    /* index of the taxel being converted */
    uint16_t saturated_conversions;
    uint8_t latches; /* modulo 256 */
    bool has_newest;
    bool has_latched;
    bool settings_pending;
    bool converting;
    bool begin_after_conversion; /* a conversion from before a stop still runs: the scan begins at its end */
    bool is_stalled;
};

struct taxel_slave {
    const uint8_t *source;  /* content of the register that is being read */
    size_t source_size;     /* in bytes */
    size_t source_position; /* of the next byte */
    uint32_t snapshot_reads;
    uint16_t bus_errors;
    uint16_t rejected_writes;
    uint8_t pointer;      /* register pointer */
    uint8_t written;      /* bytes in write_bytes */
    bool pointer_next;    /* the next byte written is the register pointer */
    bool pointer_written; /* in this transaction, and nothing after it */
    bool refused; /* a byte of this write was not acknowledged: later bytes of the write are not accepted either */
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

/* Initialise the board. `config` must stay valid. Returns 0, or TAXEL_ERROR_INVALID if crossing map, sizes or
 * settings are invalid. */
int taxel_sensor_init(struct taxel_sensor *sensor, const struct taxel_sensor_config *config);

/* Scan (scan.c). */
void taxel_scan_start(struct taxel_sensor *sensor);
void taxel_scan_stop(struct taxel_sensor *sensor);
void taxel_scan_latch(struct taxel_sensor *sensor);
/* Check whether the scan has advanced since the last call. To be called from the main loop at least every 100 ms; the
 * watchdog is fed only for TAXEL_SCAN_ADVANCED. */
enum taxel_scan_progress taxel_scan_check(struct taxel_sensor *sensor);
void taxel_sensor_on_conversion(struct taxel_sensor *sensor, uint16_t raw_count);
bool taxel_scan_settings_are_valid(const struct taxel_scan_settings *settings);

/* Return whether the converter of the board accepts scan settings. */
bool taxel_front_end_accepts(const struct taxel_sensor_hal *hal, const struct taxel_scan_settings *settings);

/* Compact snapshots (compact.c). taxel_sensor_run() is called from the main loop after interrupts;
 * taxel_sensor_has_work() returns whether it has work now. */
void taxel_sensor_run(struct taxel_sensor *sensor);
bool taxel_sensor_has_work(const struct taxel_sensor *sensor);

/* I2C slave (slave.c). on_address and on_write return whether to acknowledge. */
bool taxel_sensor_on_address(struct taxel_sensor *sensor, bool reading);
bool taxel_sensor_on_write(struct taxel_sensor *sensor, uint8_t byte);
uint8_t taxel_sensor_on_read(struct taxel_sensor *sensor);
void taxel_sensor_on_stop(struct taxel_sensor *sensor);
void taxel_sensor_on_bus_error(struct taxel_sensor *sensor);

#endif
