/* The boards and other devices on the simulated hub's bus. A transfer is executed completely at its start. */
#include "fake_hub.h"

#include "codec/crc32.h"

/* Send the address to one simulated device. Returns whether it acknowledges; a device with injected NACKs does
 * not. */
static bool address_device(struct fake_device *device, bool reading)
{
    if (device->nacks) {
        device->nacks--;
        return false;
    }
    return !device->sensor || taxel_sensor_on_address(&device->sensor->sensor, reading);
}

/* Prepare a device for being addressed: set the clock of its board and, for a read, complete one scan, unless the test
 * holds scans; also set the version of the register map that the test selects. */
static void prepare(const struct fake_hub *fake, struct fake_device *device, bool reading)
{
    struct fake_sensor *sensor = device->sensor;
    if (!sensor) {
        return;
    }
    sensor->clock_us = (uint32_t)fake->now_us + device->clock_offset_us;
    if (reading && device->held_scans) {
        device->held_scans--;
    } else if (reading) {
        fake_scan(sensor, 1);
    }
    if (device->map_version) {
        uint8_t *identity = sensor->sensor.identity;
        identity[TAXEL_IDENTITY_OFFSET_MAP_VERSION] = device->map_version;
        taxel_put_u32(identity + TAXEL_IDENTITY_OFFSET_CRC32, taxel_crc32(0, identity, TAXEL_IDENTITY_OFFSET_CRC32));
    }
}

/* Send the address for one direction to all devices. Writes to acknowledged_by[i] whether device i acknowledged.
 * Returns whether any device did. */
static bool address_all(struct fake_hub *fake, uint8_t address, bool reading, bool *acknowledged_by)
{
    bool has_answer = false;
    for (size_t i = 0; i < fake->device_count; i++) {
        struct fake_device *device = &fake->devices[i];
        acknowledged_by[i] = false;
        if (!device->unplugged && device->address == address) {
            prepare(fake, device, reading);
            acknowledged_by[i] = address_device(device, reading);
            has_answer = has_answer || acknowledged_by[i];
        }
    }
    return has_answer;
}

/* Execute the bytes of a transfer on all devices. Returns TAXEL_I2C_OK or the kind of NACK. Writes to
 * acknowledged_by[i] whether device i takes part. */
static int8_t exchange(struct fake_hub *fake, const struct taxel_i2c_transfer *transfer, bool *acknowledged_by)
{
    if (transfer->write_size || !transfer->read_size) {
        if (!address_all(fake, transfer->address, false, acknowledged_by)) {
            return TAXEL_I2C_NACK_ADDRESS;
        }
    }
    for (size_t n = 0; n < transfer->write_size; n++) {
        bool acknowledged = false;
        for (size_t i = 0; i < fake->device_count; i++) {
            struct fake_sensor *sensor = fake->devices[i].sensor;
            acknowledged |=
                acknowledged_by[i] && (!sensor || taxel_sensor_on_write(&sensor->sensor, transfer->write_bytes[n]));
        }
        if (!acknowledged) {
            return TAXEL_I2C_NACK_DATA;
        }
    }
    if (transfer->read_size && !address_all(fake, transfer->address, true, acknowledged_by)) {
        return TAXEL_I2C_NACK_ADDRESS;
    }
    size_t size = transfer->read_size;
    for (size_t n = 0; n < size; n++) {
        transfer->read_bytes[n] = 0xFF; /* open drain: a zero dominates */
        for (size_t i = 0; i < fake->device_count; i++) {
            struct fake_device *device = &fake->devices[i];
            if (acknowledged_by[i]) {
                transfer->read_bytes[n] &=
                    device->sensor ? taxel_sensor_on_read(&device->sensor->sensor) : device->foreign;
            }
        }
        size = transfer->length_prefixed && n == 0
                   ? 1u + taxel_i2c_bytes_after_length(transfer, transfer->read_bytes[0])
                   : size;
    }
    return TAXEL_I2C_OK;
}

/* Send the stop condition to all devices of a transfer, and damage one byte that was read if a device has injected
 * damage. */
static void finish_transfer(struct fake_hub *fake, const struct taxel_i2c_transfer *transfer,
                            const bool *acknowledged_by)
{
    for (size_t i = 0; i < fake->device_count; i++) {
        struct fake_device *device = &fake->devices[i];
        if (acknowledged_by[i] && transfer->read_size && device->corrupt) {
            device->corrupt--;
            transfer->read_bytes[transfer->length_prefixed ? 3u : transfer->read_size / 2u] ^= 0x04u;
        }
        if (acknowledged_by[i] && device->sensor) {
            taxel_sensor_on_stop(&device->sensor->sensor);
        }
    }
}

/* Execute an I2C transfer of the hub on the simulated devices. Returns its result (enum taxel_i2c_result). */
int8_t fake_bus_transfer(struct fake_hub *fake, const struct taxel_i2c_transfer *transfer)
{
    bool acknowledged_by[FAKE_DEVICES] = {false};
    const int8_t result = exchange(fake, transfer, acknowledged_by);
    finish_transfer(fake, transfer, acknowledged_by);
    return result;
}

/* Add `count` sensor boards with consecutive I2C addresses to the bus of the simulated hub; each has completed one
 * scan. */
void fake_hub_add_boards(struct fake_hub *fake, struct fake_sensor *sensors, uint8_t first_address, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const uint8_t address = (uint8_t)(first_address + i);
        fake_sensor_init(&sensors[i], address, 3, 4, 5);
        (void)fake_sensor_boot(&sensors[i]);
        fake_scan(&sensors[i], 1);
        (void)fake_hub_add(fake, address, &sensors[i]);
    }
}

/* Free the memory of all simulated boards on the bus. */
void fake_hub_free_boards(struct fake_hub *fake)
{
    for (size_t i = 0; i < fake->device_count; i++) {
        if (fake->devices[i].sensor) {
            fake_sensor_free(fake->devices[i].sensor);
        }
    }
}
