/* A transfer whose length only its master knows: the master gives a command, hears what has become of it, and holds SCL low until
 * it gives the next. */
#include "emulator/bus_parts.h"

/* A start condition, and the byte. */
static void send_address(struct bus *bus, uint8_t address_byte, vtime now)
{
    bus->phase = address_byte & 1u ? BUS_ADDRESS_READ : BUS_ADDRESS_WRITE;
    bus->next = vtime_max(now, bus_scl_held_until(bus)) + bus->clock + BUS_CLOCKS_PER_BYTE * bus->clock;
}

void bus_steps_begin(struct bus *bus, uint8_t address_byte, vtime now)
{
    const struct taxel_i2c_transfer transfer = {.address = address_byte >> 1};
    bus_begin(bus, BUS_HUB, &transfer, now);
    bus->by_steps = true;
    bus->result = TAXEL_I2C_OK;
    send_address(bus, address_byte, now);
    if (bus_sda_is_held(bus)) {
        bus->next = VTIME_NEVER;
    }
}

enum bus_event bus_steps_end(const struct bus *bus)
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

void bus_step_start(struct bus *bus, uint8_t address_byte, vtime now)
{
    if (bus->phase == BUS_HELD) {
        bus->transfer.address = address_byte >> 1;
        send_address(bus, address_byte, now);
    } else if (bus->phase != BUS_IDLE && bus->master != BUS_HUB) {
        bus->waits[BUS_HUB] = bus->waiting_by_steps = true;
        bus->byte_waiting = address_byte;
    } else {
        bus_steps_begin(bus, address_byte, now);
    }
}

static void go_on(struct bus *bus, enum bus_phase phase, vtime now)
{
    bus->next = now;
    bus_next_byte(bus, phase, now);
}

void bus_step_write(struct bus *bus, uint8_t byte, vtime now)
{
    bus->byte = byte;
    go_on(bus, BUS_WRITE, now);
}

void bus_step_read(struct bus *bus, vtime now)
{
    go_on(bus, BUS_READ, now);
}

void bus_step_stop(struct bus *bus, vtime now)
{
    bus->next = now;
    if (bus->slaves_send && !bus->master_reads) {
        bus_collide(bus, TAXEL_I2C_BUS_ERROR);
    } else {
        bus_send_stop(bus, now);
    }
}
