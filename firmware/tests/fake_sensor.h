/* A simulated sensor board: the sensor firmware on a HAL that the test controls step by step. */
#ifndef TAXEL_TESTS_FAKE_SENSOR_H
#define TAXEL_TESTS_FAKE_SENSOR_H

#include "sensor/sensor.h"

#define FAKE_HISTORY 1024u

struct fake_sensor {
    struct taxel_sensor sensor;
    struct taxel_sensor_config config;
    struct taxel_sensor_hal hal;
    uint8_t crossing_map[TAXEL_CROSSING_MAP_SIZE];
    uint32_t clock_us;
    uint16_t (*count_of)(struct fake_sensor *fake); /* raw count of the conversion; NULL: fake_count() */

    bool converting;
    uint8_t tx, rx; /* of the latest conversion */
    uint8_t history[FAKE_HISTORY][2];
    unsigned started, overlapping, configured, configured_while_converting, restarts, bootloader_entries;
    int interrupts_off; /* nesting */
    struct taxel_scan_settings front_end;

    /* Called at every call of the HAL with interrupts enabled, where another interrupt may preempt the code. */
    void (*preempt)(struct fake_sensor *fake);
    bool preempting;
};

/* Initialise a board of rows x columns crossings. Every crossing is a taxel except the last of each `skip` crossings
 * (0: no exception). The snapshot buffers have exactly the required size, so that a sanitizer detects an access behind
 * them. */
void fake_sensor_init(struct fake_sensor *fake, uint8_t address, uint8_t rows, uint8_t columns, unsigned skip);
int fake_sensor_boot(struct fake_sensor *fake);
void fake_sensor_free(struct fake_sensor *fake);

/* Return the raw count of a taxel in the scan with that sequence; counts differ between consecutive scans. */
uint16_t fake_count(uint16_t sequence, uint16_t taxel);

/* End the conversion in progress, if there is one, 10 us later; repeat for this number of conversions or scans. */
void fake_convert(struct fake_sensor *fake, unsigned conversions);
void fake_scan(struct fake_sensor *fake, unsigned scans);

/* Execute a complete I2C transfer as master. A write returns whether all bytes were acknowledged, a read whether the
 * address was. */
bool fake_write(struct fake_sensor *fake, const uint8_t *bytes, size_t size);
bool fake_read(struct fake_sensor *fake, uint8_t *bytes, size_t size);
bool fake_read_at(struct fake_sensor *fake, uint8_t pointer, uint8_t *bytes, size_t size);
bool fake_command(struct fake_sensor *fake, uint8_t command);
bool fake_write_settings(struct fake_sensor *fake, const struct taxel_scan_settings *settings);
struct taxel_status fake_status(struct fake_sensor *fake);

/* Return whether the bytes are a valid snapshot of this board: a correct CRC, and all counts those of fake_count() for
 * its sequence number. */
bool fake_snapshot_is_valid(const struct fake_sensor *fake, const uint8_t *bytes);

#endif
