#include "fake_sensor.h"

#include <stdlib.h>

#include "codec/crc32.h"

#define CONVERSION_US 10u

/* Call the test's function that simulates another interrupt, if interrupts are enabled and none is being
 * simulated. */
static void preempt_if_allowed(struct fake_sensor *fake)
{
    if (fake->preempt && !fake->preempting && !fake->interrupts_off) {
        fake->preempting = true;
        fake->preempt(fake);
        fake->preempting = false;
    }
}

/* Store the scan settings and count calls during a conversion; HAL function of the simulated board. */
static void on_configure(void *context, const struct taxel_scan_settings *settings)
{
    struct fake_sensor *fake = context;
    fake->configured++;
    fake->configured_while_converting += fake->converting;
    fake->front_end = *settings;
    preempt_if_allowed(fake);
}

/* Record the TX and RX line of a conversion, which fake_convert() ends; HAL function of the simulated board. */
static void on_conversion_start(void *context, uint8_t tx, uint8_t rx)
{
    struct fake_sensor *fake = context;
    preempt_if_allowed(fake);
    fake->overlapping += fake->converting;
    fake->converting = true;
    fake->tx = tx;
    fake->rx = rx;
    fake->history[fake->started % FAKE_HISTORY][0] = tx;
    fake->history[fake->started % FAKE_HISTORY][1] = rx;
    fake->started++;
}

/* Return the board's clock in microseconds; HAL function of the simulated board. */
static uint32_t on_clock_us(void *context)
{
    struct fake_sensor *fake = context;
    preempt_if_allowed(fake);
    return fake->clock_us;
}

/* Mask interrupts and return the previous state; HAL function of the simulated board. */
static uint32_t on_interrupts_disable(void *context)
{
    struct fake_sensor *fake = context;
    preempt_if_allowed(fake);
    return (uint32_t)fake->interrupts_off++;
}

/* Restore the state of the interrupt mask; HAL function of the simulated board. */
static void on_interrupts_restore(void *context, uint32_t state)
{
    struct fake_sensor *fake = context;
    fake->interrupts_off = (int)state;
    preempt_if_allowed(fake);
}

/* Count the requests for a restart; HAL function of the simulated board. */
static void on_restart(void *context)
{
    ((struct fake_sensor *)context)->restarts++;
}

/* Count the requests for the bootloader; HAL function of the simulated board. */
static void on_bootloader(void *context)
{
    ((struct fake_sensor *)context)->bootloader_entries++;
}

/* Initialise a simulated board with `rows` TX and `columns` RX lines. The last of every `skip` crossings has no
 * taxel (0: all crossings have one). */
void fake_sensor_init(struct fake_sensor *fake, uint8_t address, uint8_t rows, uint8_t columns, unsigned skip)
{
    memset(fake, 0, sizeof *fake);
    fake->hal = (struct taxel_sensor_hal){
        .context = fake,
        .front_end_configure = on_configure,
        .conversion_start = on_conversion_start,
        .clock_us = on_clock_us,
        .interrupts_disable = on_interrupts_disable,
        .interrupts_restore = on_interrupts_restore,
        .restart = on_restart,
        .enter_bootloader = on_bootloader,
    };
    fake->config = (struct taxel_sensor_config){
        .hal = &fake->hal,
        .address = address,
        .kind = 3,
        .reset_cause = TAXEL_RESET_CAUSE_WATCHDOG,
        .firmware_version = {1, 2, 3},
        .unique_id = {address, 1, 2, 3, 4, 5, 6, 7},
        .rows = rows,
        .columns = columns,
        .crossing_map = fake->crossing_map,
        .settings = {160, 40, 1, 16, 96},
    };
    for (unsigned crossing = 0; crossing < (unsigned)rows * columns; crossing++) {
        if (!skip || crossing % skip != skip - 1u) {
            fake->crossing_map[crossing >> 3] |= (uint8_t)(1u << (crossing & 7u));
            fake->config.taxel_count++;
        }
    }
    for (size_t i = 0; i < 3; i++) {
        fake->config.snapshots[i] = malloc(TAXEL_SNAPSHOT_SIZE(fake->config.taxel_count));
    }
}

/* Start the firmware of the board, which begins to scan. Returns 0, or the error of taxel_sensor_init(). */
int fake_sensor_boot(struct fake_sensor *fake)
{
    fake->converting = false;
    const int error = taxel_sensor_init(&fake->sensor, &fake->config);
    if (!error) {
        taxel_scan_start(&fake->sensor);
    }
    return error;
}

/* Free the snapshot buffers of the simulated board. */
void fake_sensor_free(struct fake_sensor *fake)
{
    for (size_t i = 0; i < 3; i++) {
        free(fake->config.snapshots[i]);
    }
}

/* Return the raw count that a simulated taxel has in the scan number `sequence`, 1 to 65535; tests recognise the scan
 * by it. */
uint16_t fake_count(uint16_t sequence, uint16_t taxel)
{
    return (uint16_t)(1u + (sequence * 251u + taxel) % 65535u);
}

/* Return the raw count of the conversion in progress: from the test's function, or fake_count(). */
static uint16_t next_count(struct fake_sensor *fake)
{
    return fake->count_of ? fake->count_of(fake)
                          : fake_count((uint16_t)fake->sensor.scan.scans, fake->sensor.scan.taxel);
}

/* End up to `conversions` conversions of the board, one after the other. */
void fake_convert(struct fake_sensor *fake, unsigned conversions)
{
    for (unsigned i = 0; i < conversions && fake->converting; i++) {
        fake->clock_us += CONVERSION_US;
        fake->converting = false;
        taxel_sensor_on_conversion(&fake->sensor, next_count(fake));
    }
}

/* Complete `scans` scans of the board. */
void fake_scan(struct fake_sensor *fake, unsigned scans)
{
    fake_convert(fake, scans * fake->config.taxel_count);
}

/* Write bytes to the board as an I2C master, with a stop condition. Returns whether all bytes were
 * acknowledged. */
bool fake_write(struct fake_sensor *fake, const uint8_t *bytes, size_t size)
{
    bool acknowledged = taxel_sensor_on_address(&fake->sensor, false);
    for (size_t i = 0; i < size && acknowledged; i++) {
        acknowledged = taxel_sensor_on_write(&fake->sensor, bytes[i]);
    }
    taxel_sensor_on_stop(&fake->sensor);
    return acknowledged;
}

/* Address the board for reading, read `size` bytes and send a stop condition. Returns whether the address was
 * acknowledged. */
static bool read_to_stop(struct fake_sensor *fake, uint8_t *bytes, size_t size)
{
    const bool acknowledged = taxel_sensor_on_address(&fake->sensor, true);
    for (size_t i = 0; i < size && acknowledged; i++) {
        bytes[i] = taxel_sensor_on_read(&fake->sensor);
    }
    taxel_sensor_on_stop(&fake->sensor);
    return acknowledged;
}

/* Read `size` bytes at the present register pointer of the board. Returns whether the address was acknowledged. */
bool fake_read(struct fake_sensor *fake, uint8_t *bytes, size_t size)
{
    return read_to_stop(fake, bytes, size);
}

/* Set the register pointer and read `size` bytes after a repeated start. Returns whether all was acknowledged. */
bool fake_read_at(struct fake_sensor *fake, uint8_t pointer, uint8_t *bytes, size_t size)
{
    return taxel_sensor_on_address(&fake->sensor, false) && taxel_sensor_on_write(&fake->sensor, pointer) &&
           read_to_stop(fake, bytes, size);
}

/* Write a command and its complement to the command register. Returns whether all bytes were acknowledged. */
bool fake_command(struct fake_sensor *fake, uint8_t command)
{
    const uint8_t bytes[3] = {TAXEL_REGISTER_COMMAND, command, (uint8_t)~command};
    return fake_write(fake, bytes, sizeof bytes);
}

/* Write scan settings with a correct CRC to the settings register. Returns whether all bytes were acknowledged. */
bool fake_write_settings(struct fake_sensor *fake, const struct taxel_scan_settings *settings)
{
    uint8_t bytes[1 + TAXEL_SETTINGS_REGISTER_SIZE] = {TAXEL_REGISTER_SETTINGS};
    taxel_scan_settings_pack(settings, bytes + 1);
    taxel_put_u32(bytes + 1 + TAXEL_SCAN_SETTINGS_SIZE,
                  taxel_crc32(taxel_crc32(0, &fake->config.address, 1), bytes + 1, TAXEL_SCAN_SETTINGS_SIZE));
    return fake_write(fake, bytes, sizeof bytes);
}

/* Read the status register of the board. */
struct taxel_status fake_status(struct fake_sensor *fake)
{
    uint8_t bytes[TAXEL_STATUS_SIZE];
    struct taxel_status status;
    (void)fake_read_at(fake, TAXEL_REGISTER_STATUS, bytes, sizeof bytes);
    taxel_status_unpack(&status, bytes);
    return status;
}

/* Return whether a snapshot has a correct CRC and its counts are those of fake_count() for its sequence number. */
bool fake_snapshot_is_valid(const struct fake_sensor *fake, const uint8_t *bytes)
{
    const uint16_t taxels = fake->config.taxel_count;
    const size_t size = TAXEL_SNAPSHOT_SIZE(taxels);
    const uint16_t sequence = taxel_get_u16(bytes);
    for (uint16_t i = 0; i < taxels; i++) {
        if (taxel_get_u16(bytes + TAXEL_SNAPSHOT_HEADER_SIZE + 2u * i) != fake_count(sequence, i)) {
            return false;
        }
    }
    return taxel_get_u32(bytes + size - 4u) == taxel_crc32(taxel_crc32(0, &fake->config.address, 1), bytes, size - 4u);
}
