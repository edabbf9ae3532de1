/* Transfers of a bytewise master: the master commands one byte or condition, receives its result, and holds SCL low
 * until the next command. */
#include "emulator/bus_internal.h"

/* Begin a start condition and the address byte. */
static void begin_address(struct bus *bus, uint8_t address_byte, vtime now)
{
    bus->phase = address_byte & 1u ? BUS_ADDRESS_READ : BUS_ADDRESS_WRITE;
    bus->next =
        bus_add_time(vtime_max(now, bus_scl_held_until(bus)), bus->scl_period + BUS_CLOCKS_PER_BYTE * bus->scl_period);
}

/* Begin a transfer of a hub that controls each byte itself, as an emulated processor does. `address_byte`: address and
 * read bit. While SDA is held low, no event occurs until the hub aborts the transfer. */
void bus_bytewise_begin(struct bus *bus, uint8_t address_byte, vtime now)
{
    const struct taxel_i2c_transfer transfer = {.address = address_byte >> 1};
    bus_begin_transfer(bus, BUS_HUB, &transfer, now);
    bus->is_bytewise = true;
    bus->result = TAXEL_I2C_OK;
    begin_address(bus, address_byte, now);
    if (bus_sda_is_held(bus)) {
        bus->next = VTIME_NEVER;
    }
}

/* Return the event with which the end of a byte-wise transfer is reported to the hub. */
enum bus_event bus_bytewise_result(const struct bus *bus)
{
    switch (bus->result) {
    case TAXEL_I2C_OK:
        return BUS_STOPPED;
    case TAXEL_I2C_ARBITRATION_LOST:
        return BUS_ARBITRATION_LOST;
    default:
        return BUS_ERROR;
    }
}

/* Begin a start or repeated start condition with this address byte, on the command of the hub. Waits if the other
 * master uses the bus. */
void bus_bytewise_start(struct bus *bus, uint8_t address_byte, vtime now)
{
    if (bus->phase == BUS_HELD) {
        bus->transfer.address = address_byte >> 1;
        begin_address(bus, address_byte, now);
    } else if (bus->phase != BUS_IDLE && bus->master != BUS_HUB) {
        bus->is_waiting[BUS_HUB] = bus->hub_waits_bytewise = true;
        bus->waiting_address_byte = address_byte;
    } else {
        bus_bytewise_begin(bus, address_byte, now);
    }
}

/* Start one byte at the virtual time `now`, on the command of an executed program that controls the bus byte by
 * byte. */
static void begin_commanded_byte(struct bus *bus, enum bus_phase phase, vtime now)
{
    bus->next = now;
    bus_begin_byte(bus, phase, now);
}

/* Write one byte to the addressed slave, from the virtual time `now` on. */
void bus_bytewise_write(struct bus *bus, uint8_t byte, vtime now)
{
    bus->byte = byte;
    begin_commanded_byte(bus, BUS_WRITE, now);
}

/* Read one byte from the addressed slave, from the virtual time `now` on. */
void bus_bytewise_read(struct bus *bus, vtime now)
{
    begin_commanded_byte(bus, BUS_READ, now);
}

/* Begin a stop condition, on the command of the hub. If a board transmits although the master writes, the stop
 * condition collides with its data. */
void bus_bytewise_stop(struct bus *bus, vtime now)
{
    bus->next = now;
    if (bus->slaves_transmit && !bus->master_reads) {
        bus_handle_collision(bus, TAXEL_I2C_BUS_ERROR);
    } else {
        bus_begin_stop(bus, now);
    }
}
