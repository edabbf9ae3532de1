/* The I2C register machine. The first byte of a write is the register pointer; the bytes after it take effect
 * together, or not at all, at the stop condition. A read begins at the last pointer written, so that a poll needs no
 * write. */
#include "codec/crc32.h"
#include "sensor/sensor.h"

/* Increment a counter, which stays at 65535 once it has reached this value. */
static void count_u16(uint16_t *counter)
{
    if (*counter < 0xFFFFu) {
        (*counter)++;
    }
}

/* Copy the current status into the buffer of the status register, so that all bytes of one read belong to the same
 * instant. */
static void fill_status(struct taxel_sensor *sensor)
{
    const struct taxel_sensor_hal *hal = sensor->config->hal;
    const struct taxel_status status = {
        .state = sensor->state,
        .error_flags = sensor->error_flags,
        .reset_cause = sensor->config->reset_cause,
        .settings_generation = sensor->settings_generation,
        .clock_us = hal->clock_us(hal->context),
        .scans = sensor->scan.scans,
        .scan_time_us = sensor->scan.scan_time_us,
        .snapshot_reads = sensor->slave.snapshot_reads,
        .bus_errors = sensor->slave.bus_errors,
        .rejected_writes = sensor->slave.rejected_writes,
        .front_end = sensor->config->front_end,
        .saturated_conversions = sensor->scan.saturated_conversions,
    };
    taxel_status_pack(&status, sensor->slave.shadow);
}

/* Compute the CRC-32 of the board's I2C address followed by the 8 bytes of scan settings in `bytes`. */
static uint32_t settings_crc(const struct taxel_sensor *sensor, const uint8_t *bytes)
{
    return taxel_crc32(taxel_crc32(0, &sensor->config->address, 1), bytes, TAXEL_SCAN_SETTINGS_SIZE);
}

/* Copy the scan settings with their CRC into the buffer of the settings register. Settings that take effect with
 * the next scan are already returned. */
static void fill_settings(struct taxel_sensor *sensor)
{
    const struct taxel_scan_settings *settings =
        sensor->scan.settings_pending ? &sensor->next_settings : &sensor->settings;
    taxel_scan_settings_pack(settings, sensor->slave.shadow);
    taxel_put_u32(sensor->slave.shadow + TAXEL_SETTINGS_REGISTER_OFFSET_CRC32,
                  settings_crc(sensor, sensor->slave.shadow));
}

/* Copy the fault record with its CRC into the buffer of the fault register; zeros without a fault. */
static void fill_fault(struct taxel_sensor *sensor)
{
    uint8_t *shadow = sensor->slave.shadow;
    memset(shadow, 0, TAXEL_FAULT_RECORD_SIZE);
    if (sensor->config->fault_record) {
        memcpy(shadow, sensor->config->fault_record, TAXEL_FAULT_RECORD_SIZE);
    }
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &sensor->config->address, 1), shadow, TAXEL_FAULT_RECORD_SIZE);
    taxel_put_u32(shadow + TAXEL_FAULT_REGISTER_OFFSET_CRC32, crc);
}

/* Set the source of the next read: the master gets the `size` bytes of a register in `bytes`, from byte `skip` on. */
static void read_from(struct taxel_slave *slave, const uint8_t *bytes, size_t size, size_t skip)
{
    slave->source = bytes;
    slave->source_size = size;
    slave->source_position = skip;
}

/* Begin a read of the snapshot registers. The first register (SNAPSHOT) latches the newest snapshot; register SNAPSHOT
 * + n returns the latched snapshot from byte n * TAXEL_SMBUS_BLOCK on. Returns false (NACK) if no snapshot is
 * latched. */
static bool begin_snapshot_read(struct taxel_sensor *sensor)
{
    struct taxel_slave *slave = &sensor->slave;
    const size_t block = (size_t)slave->pointer - TAXEL_REGISTER_SNAPSHOT;
    if (block == 0) {
        taxel_scan_latch(sensor);
    }
    if (!sensor->scan.has_latched) {
        return false; /* no scan has been completed yet */
    }
    slave->snapshot_reads += block == 0;
    read_from(slave, sensor->scan.latched, TAXEL_SNAPSHOT_SIZE(sensor->config->taxel_count), TAXEL_SMBUS_BLOCK * block);
    return true;
}

/* Begin a read at the register pointer. Status and settings are copied first, so that a read is consistent; undefined
 * registers read as 0xFF. Returns whether the address is acknowledged. */
static bool begin_read(struct taxel_sensor *sensor)
{
    struct taxel_slave *slave = &sensor->slave;
    const size_t pointer = slave->pointer;
    if (pointer >= TAXEL_REGISTER_SNAPSHOT && pointer <= TAXEL_REGISTER_SNAPSHOT_LAST) {
        return begin_snapshot_read(sensor);
    }
    if (pointer == TAXEL_REGISTER_COMPACT && taxel_sensor_has_compact(sensor)) {
        taxel_sensor_compact_begin_read(sensor, slave->pointer_written);
        return true;
    }
    if (pointer >= TAXEL_REGISTER_SETTINGS && pointer < TAXEL_REGISTER_SETTINGS + TAXEL_SETTINGS_REGISTER_SIZE) {
        fill_settings(sensor);
        read_from(slave, slave->shadow, TAXEL_SETTINGS_REGISTER_SIZE, pointer - TAXEL_REGISTER_SETTINGS);
    } else if (pointer >= TAXEL_REGISTER_STATUS && pointer < TAXEL_REGISTER_STATUS + TAXEL_STATUS_SIZE) {
        fill_status(sensor);
        read_from(slave, slave->shadow, TAXEL_STATUS_SIZE, pointer - TAXEL_REGISTER_STATUS);
    } else if (pointer == TAXEL_REGISTER_FAULT) {
        fill_fault(sensor);
        read_from(slave, slave->shadow, TAXEL_FAULT_REGISTER_SIZE, 0);
    } else if (pointer < TAXEL_IDENTITY_SIZE) {
        read_from(slave, sensor->identity, TAXEL_IDENTITY_SIZE, pointer);
    } else {
        read_from(slave, sensor->identity, 0, 0);
    }
    return true;
}

/* Count a rejected write of the master and set `flag` (TAXEL_BOARD_ERROR_FLAG_...) in the error flags. */
static void reject_write(struct taxel_sensor *sensor, uint8_t flag)
{
    count_u16(&sensor->slave.rejected_writes);
    sensor->error_flags |= flag;
}

/* Compute the CRC-32 of a write of scan settings, which covers the board's I2C address, the board's front end (kind of
 * converter) unless it is 0, and the 8 bytes of settings. A board thus rejects settings for another converter. */
static uint32_t written_settings_crc(const struct taxel_sensor *sensor, const uint8_t *bytes)
{
    const uint8_t tag[2] = {sensor->config->address, sensor->config->front_end};
    return taxel_crc32(taxel_crc32(0, tag, tag[1] ? 2 : 1), bytes, TAXEL_SCAN_SETTINGS_SIZE);
}

/* Accept the scan settings written to register SETTINGS if length, range and CRC are correct; otherwise count a
 * rejected write. Accepted settings take effect at the start of the next scan. */
static void write_settings(struct taxel_sensor *sensor)
{
    const uint8_t *bytes = sensor->slave.write_bytes;
    struct taxel_scan_settings settings;
    taxel_scan_settings_unpack(&settings, bytes);
    if (sensor->slave.written != TAXEL_SETTINGS_REGISTER_SIZE ||
        !taxel_front_end_accepts(sensor->config->hal, &settings) ||
        taxel_get_u32(bytes + TAXEL_SETTINGS_REGISTER_OFFSET_CRC32) != written_settings_crc(sensor, bytes)) {
        reject_write(sensor, TAXEL_BOARD_ERROR_FLAG_SETTINGS_REJECTED);
        return;
    }
    sensor->next_settings = settings;
    sensor->scan.settings_pending = true;
}

/* Execute the command CLEAR_COUNTERS: set the error flags and the error and read counters of the status register to 0.
 * The number of scans is kept. */
static void clear_counters(struct taxel_sensor *sensor)
{
    sensor->error_flags = 0;
    sensor->slave.bus_errors = 0;
    sensor->slave.rejected_writes = 0;
    sensor->slave.snapshot_reads = 0;
    sensor->scan.saturated_conversions = 0;
}

/* Return the code of the command that the written bytes form, or 0 if they form none. A command is its code and the
 * code's complement, so a damaged byte has no effect. The key of ENTER_BOOTLOADER prevents two bytes of a mistaken
 * transfer from stopping the application. */
static uint8_t written_command(const struct taxel_slave *slave)
{
    const uint8_t *bytes = slave->write_bytes;
    if (slave->written < TAXEL_COMMAND_REGISTER_SIZE || (bytes[0] ^ bytes[1]) != 0xFF) {
        return 0;
    }
    if (bytes[0] != TAXEL_BOARD_COMMAND_ENTER_BOOTLOADER) {
        return slave->written == TAXEL_COMMAND_REGISTER_SIZE ? bytes[0] : 0;
    }
    const bool has_key = slave->written == TAXEL_ENTER_BOOTLOADER_REGISTER_SIZE &&
                         taxel_get_u32(bytes + TAXEL_ENTER_BOOTLOADER_REGISTER_OFFSET_KEY) == TAXEL_BOOTLOADER_KEY;
    return has_key ? bytes[0] : 0;
}

/* Execute the command written to register COMMAND; an undefined one is a rejected write. */
static void write_command(struct taxel_sensor *sensor)
{
    const struct taxel_sensor_hal *hal = sensor->config->hal;
    switch (written_command(&sensor->slave)) {
    case TAXEL_BOARD_COMMAND_START_SCAN:
        taxel_scan_start(sensor);
        break;
    case TAXEL_BOARD_COMMAND_STOP_SCAN:
        taxel_scan_stop(sensor);
        break;
    case TAXEL_BOARD_COMMAND_CLEAR_COUNTERS:
        clear_counters(sensor);
        break;
    case TAXEL_BOARD_COMMAND_RESTART:
        hal->restart(hal->context);
        break;
    case TAXEL_BOARD_COMMAND_ENTER_BOOTLOADER:
        hal->enter_bootloader(hal->context);
        break;
    default:
        reject_write(sensor, TAXEL_BOARD_ERROR_FLAG_COMMAND_REJECTED);
        break;
    }
}

/* Handle the I2C interrupt of a start condition with the board's address, for reading or for writing. Returns whether
 * to acknowledge. */
bool taxel_sensor_on_address(struct taxel_sensor *sensor, bool reading)
{
    struct taxel_slave *slave = &sensor->slave;
    slave->refused = false;
    taxel_sensor_compact_end_read(sensor);
    slave->written = 0; /* a repeated start discards an unfinished write: only a stop condition completes it */
    if (reading) {
        slave->pointer_next = false;
        return begin_read(sensor);
    }
    slave->pointer_next = true;
    return true;
}

/* Handle the I2C interrupt of a byte that the master wrote. The first one is the register pointer; the others are kept
 * until the stop condition. Too many bytes are a rejected write. Returns whether to acknowledge. */
bool taxel_sensor_on_write(struct taxel_sensor *sensor, uint8_t byte)
{
    struct taxel_slave *slave = &sensor->slave;
    if (slave->pointer_next) {
        slave->pointer_next = false;
        slave->pointer = byte;
        slave->pointer_written = true;
        return true;
    }
    slave->pointer_written = false;
    if (slave->refused) {
        return false; /* the master ignores the missing acknowledge */
    }
    if (slave->written == sizeof slave->write_bytes) {
        slave->written = 0;
        slave->refused = true;
        reject_write(sensor, TAXEL_BOARD_ERROR_FLAG_READ_ONLY_WRITE);
        return false;
    }
    slave->write_bytes[slave->written++] = byte;
    return true;
}

/* Return the next byte for a master that reads (I2C interrupt); 0xFF beyond the end of the register. */
uint8_t taxel_sensor_on_read(struct taxel_sensor *sensor)
{
    struct taxel_slave *slave = &sensor->slave;
    if (slave->source_position >= slave->source_size) {
        return 0xFF;
    }
    return slave->source[slave->source_position++];
}

/* Handle the I2C interrupt of a stop condition. Bytes written to SETTINGS, COMMAND or COMPACT take effect now; writes
 * to other registers are rejected and counted. */
void taxel_sensor_on_stop(struct taxel_sensor *sensor)
{
    struct taxel_slave *slave = &sensor->slave;
    if (slave->written) {
        if (slave->pointer == TAXEL_REGISTER_SETTINGS) {
            write_settings(sensor);
        } else if (slave->pointer == TAXEL_REGISTER_COMMAND) {
            write_command(sensor);
        } else if (slave->pointer != TAXEL_REGISTER_COMPACT || !taxel_sensor_has_compact(sensor) ||
                   !taxel_sensor_compact_write(sensor, slave->write_bytes, slave->written)) {
            reject_write(sensor, TAXEL_BOARD_ERROR_FLAG_READ_ONLY_WRITE);
        }
    }
    taxel_sensor_compact_end_read(sensor);
    slave->written = 0;
    slave->pointer_next = false;
    slave->pointer_written = false;
}

/* Handle the I2C interrupt of a start or stop condition at a wrong position: count it and discard the bytes written in
 * this transfer. */
void taxel_sensor_on_bus_error(struct taxel_sensor *sensor)
{
    count_u16(&sensor->slave.bus_errors);
    taxel_sensor_compact_end_read(sensor);
    sensor->slave.written = 0;
    sensor->slave.pointer_next = false;
    sensor->slave.pointer_written = false;
}
