/* The scan sequencer: over all crossings that are taxels, TX line by TX line and on each of them RX line by RX line,
 * repeatedly. */
#include "codec/crc32.h"
#include "sensor/sensor.h"

/* Return whether scan settings are valid: the largest raw count, sub-conversions times sense clock divider, is 1 to
 * 65535, and neither the modulator clock divider nor the current code is 0. */
bool taxel_scan_settings_are_valid(const struct taxel_scan_settings *settings)
{
    const uint32_t largest_count = (uint32_t)settings->sub_conversions * settings->sense_clock_divider;
    return largest_count >= 1u && largest_count <= 0xFFFFu && settings->modulator_clock_divider >= 1u &&
           settings->idac_code >= 1u;
}

/* Return whether the board's converter accepts scan settings. A port without a check of its own has the limits of the
 * front end CAPSENSE. */
bool taxel_front_end_accepts(const struct taxel_sensor_hal *hal, const struct taxel_scan_settings *settings)
{
    return hal->front_end_accepts ? hal->front_end_accepts(hal->context, settings)
                                  : taxel_scan_settings_are_valid(settings);
}

/* Return whether crossing number `crossing` (tx * columns + rx) of the board carries a taxel. */
static bool is_taxel(const struct taxel_sensor *sensor, uint16_t crossing)
{
    return ((unsigned)sensor->config->crossing_map[crossing >> 3] >> (crossing & 7u)) & 1u;
}

/* Start the conversion of the scan's next taxel. Crossings that are not taxels in the crossing map are skipped; a
 * crossing's index is tx * columns + rx. */
static void convert_next(struct taxel_sensor *sensor)
{
    struct taxel_scan *scan = &sensor->scan;
    const struct taxel_sensor_hal *hal = sensor->config->hal;
    while (!is_taxel(sensor, scan->crossing)) {
        scan->crossing++; /* terminates: the map has at least one more bit set, because the scan is not complete */
    }
    const uint8_t tx = (uint8_t)(scan->crossing / sensor->config->columns);
    const uint8_t rx = (uint8_t)(scan->crossing % sensor->config->columns);
    scan->crossing++;
    scan->converting = true;
    hal->conversion_start(hal->context, tx, rx);
}

/* Begin a scan: apply new settings, write the snapshot's header with the start time, and start the first conversion.
 * The CRC begins with the I2C address, so that a snapshot of another board is detected. */
static void begin_scan(struct taxel_sensor *sensor)
{
    struct taxel_scan *scan = &sensor->scan;
    const struct taxel_sensor_hal *hal = sensor->config->hal;
    if (scan->settings_pending) {
        scan->settings_pending = false;
        sensor->settings = sensor->next_settings;
        sensor->settings_generation++;
        hal->front_end_configure(hal->context, &sensor->settings);
    }
    scan->crossing = 0;
    scan->taxel = 0;
    scan->started_us = hal->clock_us(hal->context);
    const struct taxel_snapshot_header header = {
        .sequence = (uint16_t)scan->scans,
        .timestamp_us = scan->started_us,
    };
    taxel_snapshot_header_pack(&header, scan->scanning);
    scan->crc = taxel_crc32(0, &sensor->config->address, 1);
    scan->crc = taxel_crc32(scan->crc, scan->scanning, TAXEL_SNAPSHOT_HEADER_SIZE);
    convert_next(sensor);
}

/* Complete the snapshot with its CRC and make it the newest one; the next scan uses the buffer of the previous newest
 * one. Interrupts are off during the exchange, because a reader may latch the newest snapshot. */
static void complete_scan(struct taxel_sensor *sensor)
{
    struct taxel_scan *scan = &sensor->scan;
    const struct taxel_sensor_hal *hal = sensor->config->hal;
    taxel_put_u32(scan->scanning + TAXEL_SNAPSHOT_HEADER_SIZE + 2u * sensor->config->taxel_count, scan->crc);
    scan->scan_time_us = hal->clock_us(hal->context) - scan->started_us;
    scan->scans++;
    const uint32_t interrupts = hal->interrupts_disable(hal->context);
    uint8_t *const finished = scan->scanning;
    scan->scanning = scan->newest;
    scan->newest = finished;
    scan->has_newest = true;
    hal->interrupts_restore(hal->context, interrupts);
}

/* Start continuous scans. If the last conversion before a stop is still running, the first scan begins at its end. */
void taxel_scan_start(struct taxel_sensor *sensor)
{
    struct taxel_scan *scan = &sensor->scan;
    if (sensor->state == TAXEL_SENSOR_SCANNING) {
        return;
    }
    sensor->state = TAXEL_SENSOR_SCANNING;
    if (scan->converting) {
        scan->begin_after_conversion = true; /* the last conversion before the stop is still running */
        return;
    }
    begin_scan(sensor);
}

/* Stop scanning; the incomplete scan is discarded. */
void taxel_scan_stop(struct taxel_sensor *sensor)
{
    sensor->state = TAXEL_SENSOR_STOPPED;
}

/* Store the raw count of a conversion that has ended (interrupt), then start the next conversion, or complete the scan
 * and begin the next one. A raw count of 0 is counted as saturated. A conversion that began before a stop is
 * discarded. */
void taxel_sensor_on_conversion(struct taxel_sensor *sensor, uint16_t raw_count)
{
    struct taxel_scan *scan = &sensor->scan;
    const bool is_stale = scan->begin_after_conversion;
    scan->converting = false;
    scan->begin_after_conversion = false;
    if (sensor->state != TAXEL_SENSOR_SCANNING) {
        return; /* stopped during a scan: the incomplete scan is discarded */
    }
    if (is_stale) {
        begin_scan(sensor);
        return;
    }
    uint8_t *const bytes = scan->scanning + TAXEL_SNAPSHOT_HEADER_SIZE + 2u * scan->taxel;
    taxel_put_u16(bytes, raw_count);
    scan->crc = taxel_crc32(scan->crc, bytes, 2);
    if (raw_count == 0 && scan->saturated_conversions < 0xFFFFu) {
        scan->saturated_conversions++;
        sensor->error_flags |= TAXEL_BOARD_ERROR_FLAG_SATURATED;
    }
    scan->taxel++;
    if (scan->taxel < sensor->config->taxel_count) {
        convert_next(sensor);
        return;
    }
    complete_scan(sensor);
    begin_scan(sensor);
}

/* Return a number that changes with every conversion of a scan and repeats after 256 scans. A check that falls on a
 * repeated number wrongly finds no progress, but the next check finds it. */
static uint16_t scan_position(const struct taxel_scan *scan)
{
    return (uint16_t)((scan->scans << 8) + scan->taxel);
}

/* Check whether the scan has advanced since the last call, for the watchdog. A scan without a conversion for
 * TAXEL_SCAN_STALL_US is reported as STALLED once and sets the error flag NOT_SCANNING. */
enum taxel_scan_progress taxel_scan_check(struct taxel_sensor *sensor)
{
    struct taxel_scan *scan = &sensor->scan;
    const struct taxel_sensor_hal *hal = sensor->config->hal;
    const uint32_t now = hal->clock_us(hal->context);
    const uint16_t position = scan_position(scan);
    if (sensor->state != TAXEL_SENSOR_SCANNING || position != scan->checked_position) {
        scan->checked_position = position;
        scan->checked_us = now;
        scan->is_stalled = false;
        return TAXEL_SCAN_ADVANCED;
    }
    if (scan->is_stalled || now - scan->checked_us < TAXEL_SCAN_STALL_US) {
        return TAXEL_SCAN_WAITING;
    }
    scan->is_stalled = true;
    sensor->error_flags |= TAXEL_BOARD_ERROR_FLAG_NOT_SCANNING;
    return TAXEL_SCAN_STALLED;
}

/* Give the newest complete snapshot to the reader. Without a new scan since the last call, the reader keeps the
 * previous snapshot. */
void taxel_scan_latch(struct taxel_sensor *sensor)
{
    struct taxel_scan *scan = &sensor->scan;
    const struct taxel_sensor_hal *hal = sensor->config->hal;
    const uint32_t interrupts = hal->interrupts_disable(hal->context);
    if (scan->has_newest) {
        uint8_t *const free_buffer = scan->latched;
        scan->latched = scan->newest;
        scan->newest = free_buffer;
        scan->has_newest = false;
        scan->has_latched = true;
        scan->latches++;
    }
    hal->interrupts_restore(hal->context, interrupts);
}
