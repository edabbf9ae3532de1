#include "emulator/bus.h"

#include <string.h>

#define CLOCKS_PER_BYTE 9u /* eight bits and the acknowledge */
#define SLAVES_MAX 4u

void bus_init(struct bus *bus, struct board_node *boards, size_t board_count, double scl_hz)
{
    memset(bus, 0, sizeof *bus);
    bus->boards = boards;
    bus->board_count = board_count;
    bus->clock = (vtime)((double)VTIME_SECOND / scl_hz);
    bus->next = VTIME_NEVER;
    bus->scl_high = bus->sda_high = true;
}

static bool sda_is_held(const struct bus *bus)
{
    if (!bus->may_be_held) {
        return false; /* the common case, asked for every byte */
    }
    for (size_t i = 0; i < bus->board_count; i++) {
        if (bus->boards[i].powered && bus->boards[i].hold_clocks) {
            return true;
        }
    }
    return false;
}

bool bus_sda(const struct bus *bus)
{
    return bus->sda_high && !sda_is_held(bus);
}

void bus_drive(struct bus *bus, bool scl_high, bool sda_high)
{
    if (bus->scl_high && !scl_high) {
        for (size_t i = 0; i < bus->board_count; i++) {
            if (bus->boards[i].hold_clocks) {
                bus->boards[i].hold_clocks--;
            }
        }
    }
    bus->scl_high = scl_high;
    bus->sda_high = sda_high;
}

void bus_start(struct bus *bus, const struct taxel_i2c_transfer *transfer, vtime now)
{
    bus->transfer = *transfer;
    bus->index = 0;
    bus->slave_count = 0;
    bus->transfers++;
    bus->started = now;
    if (sda_is_held(bus)) {
        bus->result = TAXEL_I2C_BUSY;
        bus->phase = BUS_DONE;
        bus->next = now + bus->clock;
        return;
    }
    bus->result = TAXEL_I2C_OK;
    bus->phase = transfer->write_size || !transfer->read_size ? BUS_ADDRESS_WRITE : BUS_ADDRESS_READ;
    bus->next = now + bus->clock + CLOCKS_PER_BYTE * bus->clock; /* start condition, then the address byte */
}

void bus_abort(struct bus *bus)
{
    bus->phase = BUS_IDLE;
    bus->next = VTIME_NEVER;
    bus->scl_high = bus->sda_high = true;
}

static void next_byte(struct bus *bus, enum bus_phase phase, vtime released)
{
    bus->phase = phase;
    bus->next = vtime_max(bus->next, released) + CLOCKS_PER_BYTE * bus->clock;
}

static void stop(struct bus *bus, vtime released)
{
    bus->phase = BUS_STOP;
    bus->next = vtime_max(bus->next, released) + bus->clock;
}

static bool call_slaves(struct bus *bus, bool reading, vtime *released)
{
    *released = bus->next;
    bus->slave_count = 0;
    for (size_t i = 0; i < bus->board_count && bus->slave_count < SLAVES_MAX; i++) {
        struct board_node *board = &bus->boards[i];
        bool acknowledge = false;
        if (!board_answers(board, bus->next, bus->transfer.address)) {
            continue;
        }
        *released = vtime_max(*released, board_address(board, bus->next, reading, &acknowledge));
        if (acknowledge) {
            bus->slaves[bus->slave_count++] = board;
        }
    }
    return bus->slave_count > 0;
}

static void after_writing(struct bus *bus, vtime released)
{
    if (bus->transfer.read_size) {
        next_byte(bus, BUS_ADDRESS_READ, released + bus->clock); /* repeated start */
    } else {
        stop(bus, released);
    }
}

static void end_address(struct bus *bus, bool reading)
{
    vtime released;
    bus->bytes++;
    if (!call_slaves(bus, reading, &released)) {
        bus->result = TAXEL_I2C_NACK_ADDRESS;
        stop(bus, released);
        return;
    }
    bus->index = 0;
    if (reading) {
        next_byte(bus, BUS_READ, released);
    } else if (bus->transfer.write_size) {
        next_byte(bus, BUS_WRITE, released);
    } else {
        after_writing(bus, released);
    }
}

static void end_write(struct bus *bus)
{
    bool acknowledged = false;
    vtime released = bus->next;
    bus->bytes++;
    for (size_t i = 0; i < bus->slave_count; i++) {
        bool acknowledge = false;
        if (bus->slaves[i]->powered) {
            released = vtime_max(released, board_write(bus->slaves[i], bus->next, bus->transfer.write_bytes[bus->index], &acknowledge));
        }
        acknowledged = acknowledged || acknowledge;
    }
    bus->index++;
    if (!acknowledged) {
        bus->result = TAXEL_I2C_NACK_DATA;
        stop(bus, released);
    } else if (bus->index < bus->transfer.write_size) {
        next_byte(bus, BUS_WRITE, released);
    } else {
        after_writing(bus, released);
    }
}

static void end_read(struct bus *bus)
{
    uint8_t line = 0xFF; /* open drain: a zero wins */
    vtime released = bus->next;
    bus->bytes++;
    for (size_t i = 0; i < bus->slave_count; i++) {
        uint8_t byte = 0xFF;
        if (bus->slaves[i]->powered) {
            released = vtime_max(released, board_read(bus->slaves[i], bus->next, &byte));
        }
        line &= byte;
    }
    bus->transfer.read_bytes[bus->index++] = sda_is_held(bus) ? 0 : line;
    if (bus->index < bus->transfer.read_size) {
        next_byte(bus, BUS_READ, released);
    } else {
        stop(bus, released);
    }
}

static void end_stop(struct bus *bus)
{
    for (size_t i = 0; i < bus->slave_count; i++) {
        if (bus->slaves[i]->powered) {
            board_stop(bus->slaves[i], bus->next);
        }
    }
    if (sda_is_held(bus)) {
        bus->result = TAXEL_I2C_BUS_ERROR; /* SDA did not rise: there was no stop condition */
    }
    bus->slave_count = 0;
    bus->phase = BUS_DONE;
}

bool bus_run(struct bus *bus, vtime horizon)
{
    while (bus->next <= horizon) {
        switch (bus->phase) {
        case BUS_ADDRESS_WRITE:
            end_address(bus, false);
            break;
        case BUS_WRITE:
            end_write(bus);
            break;
        case BUS_ADDRESS_READ:
            end_address(bus, true);
            break;
        case BUS_READ:
            end_read(bus);
            break;
        case BUS_STOP:
            end_stop(bus);
            break;
        default:
            bus->phase = BUS_IDLE;
            bus->busy += bus->next - bus->started;
            return true;
        }
    }
    return false;
}
