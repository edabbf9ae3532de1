#include "emulator/bus_parts.h"

#include <string.h>

#define SLAVES_MAX 32u

void bus_init(struct bus *bus, struct board_node *boards, size_t board_count, double scl_hz, struct fault_log *log)
{
    memset(bus, 0, sizeof *bus);
    bus->boards = boards;
    bus->board_count = board_count;
    bus->clock = (vtime)((double)VTIME_SECOND / scl_hz);
    bus->next = VTIME_NEVER;
    bus->scl_high = bus->sda_high = true;
    bus->log = log;
}

bool bus_scl(const struct bus *bus, vtime now)
{
    return bus->scl_high && now >= bus_scl_held_until(bus);
}

bool bus_sda(const struct bus *bus)
{
    return bus->sda_high && !bus_sda_is_held(bus);
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

void bus_begin(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now)
{
    bus->master = master;
    bus->transfer = *transfer;
    bus->index = 0;
    bus->wire_byte = 0;
    bus->slave_count = 0;
    bus->slaves_send = false;
    bus->let_go = false;
    bus->transfers++;
    bus->started = now;
    bus->by_steps = false;
    if (bus_sda_is_held(bus) || now < bus_scl_held_until(bus)) {
        bus->result = TAXEL_I2C_BUSY;
        bus->phase = BUS_DONE;
        bus->next = now + bus->clock;
        return;
    }
    bus->result = TAXEL_I2C_OK;
    bus->phase = transfer->write_size || !transfer->read_size ? BUS_ADDRESS_WRITE : BUS_ADDRESS_READ;
    bus->next = now + bus->clock + BUS_CLOCKS_PER_BYTE * bus->clock; /* start condition, then the address byte */
}

void bus_start(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now)
{
    if (bus->phase != BUS_IDLE && bus->master != master) {
        bus->waits[master] = true;
        bus->waiting[master] = *transfer;
        return;
    }
    bus_begin(bus, master, transfer, now);
}

void bus_hand_over(struct bus *bus, vtime now)
{
    const enum bus_master other = bus->master == BUS_HUB ? BUS_ADAPTER : BUS_HUB;
    bus->phase = BUS_IDLE;
    bus->next = VTIME_NEVER;
    if (bus->waits[other] && other == BUS_HUB && bus->waiting_by_steps) {
        bus->waits[other] = false;
        bus_steps_begin(bus, bus->byte_waiting, now);
    } else if (bus->waits[other]) {
        bus->waits[other] = false;
        bus_begin(bus, other, &bus->waiting[other], now);
    }
}

void bus_abort(struct bus *bus, enum bus_master master, vtime now)
{
    bus->waits[master] = false;
    bus->scl_high = bus->sda_high = true;
    if (bus->master == master) {
        bus_hand_over(bus, now);
    }
}

/* The master of a stepped transfer hears what has become of its byte, and holds SCL until it knows how to go on. */
static void hold(struct bus *bus, enum bus_event event, vtime released)
{
    bus->phase = BUS_HELD;
    bus->event = event;
    bus->next = vtime_max(bus->next, vtime_max(released, bus_scl_held_until(bus)));
}

/* When the master goes on after a byte. */
static vtime let_go(const struct bus *bus, vtime released)
{
    const vtime hold = bus->master == BUS_HUB && !bus->by_steps ? bus->hold : 0;
    return vtime_max(bus->next, vtime_max(released, bus_scl_held_until(bus))) + hold;
}

void bus_next_byte(struct bus *bus, enum bus_phase phase, vtime released)
{
    bus->phase = phase;
    bus->next = let_go(bus, released) + BUS_CLOCKS_PER_BYTE * bus->clock;
}

void bus_send_stop(struct bus *bus, vtime released)
{
    bus->phase = BUS_STOP;
    bus->next = let_go(bus, released) + bus->clock;
}

/* The master has lost the bus in the middle of a transfer: no stop of its own. */
static void lose(struct bus *bus, int8_t result)
{
    for (size_t i = 0; i < bus->slave_count; i++) {
        if (bus->slaves[i]->powered) {
            board_bus_error(bus->slaves[i], bus->next);
        }
    }
    bus->slave_count = 0;
    bus->result = result;
    bus->phase = BUS_DONE;
    bus->next += bus->clock;
}

static struct byte_damage next_damage(struct bus *bus)
{
    const unsigned position = bus->wire_byte++;
    bus->bytes++;
    if (!bus->faults.count) {
        return (struct byte_damage){.nack = false};
    }
    const struct byte_damage damage =
        bus_faults_take(&bus->faults, bus->transfer.address, position, bus->next, bus->log);
    for (size_t i = 0; damage.brown_out && i < bus->board_count; i++) {
        struct board_node *board = &bus->boards[i];
        if (board->address == bus->transfer.address && board->powered) {
            board_advance(board, bus->next); /* what it has measured by then does not hang on who looked at it last */
            board_power(board, false, bus->next, TAXEL_RESET_CAUSE_BROWN_OUT);
            board_power(board, true, bus->next + damage.off_time, TAXEL_RESET_CAUSE_BROWN_OUT);
            bus->slave_count = 0; /* nobody else was called */
        }
    }
    return damage;
}

static bool ends_the_transfer(struct bus *bus, const struct byte_damage *damage)
{
    if (damage->arbitration || damage->bus_error) {
        lose(bus, damage->arbitration ? TAXEL_I2C_ARBITRATION_LOST : TAXEL_I2C_BUS_ERROR);
        return true;
    }
    return false;
}

static bool call_slaves(struct bus *bus, uint8_t address, vtime *released)
{
    *released = bus->next;
    bus->slave_count = 0;
    for (size_t i = 0; i < bus->board_count && bus->slave_count < SLAVES_MAX; i++) {
        struct board_node *board = &bus->boards[i];
        bool acknowledge = false;
        if (!board_answers(board, bus->next, address)) {
            continue;
        }
        *released = vtime_max(*released, board_address(board, bus->next, bus->slaves_send, &acknowledge));
        if (acknowledge) {
            bus->slaves[bus->slave_count++] = board;
        }
    }
    return bus->slave_count > 0;
}

static void after_writing(struct bus *bus, vtime released)
{
    if (bus->transfer.read_size) {
        bus_next_byte(bus, BUS_ADDRESS_READ, released + bus->clock); /* repeated start */
    } else {
        bus_send_stop(bus, released);
    }
}

void bus_collide(struct bus *bus, int8_t result)
{
    for (size_t i = 0; i < bus->slave_count; i++) {
        bus->slaves[i]->hold_clocks = BUS_CLOCKS_PER_BYTE - 1u;
        bus->may_be_held = true;
    }
    lose(bus, result);
}

static void end_address(struct bus *bus, bool reading)
{
    vtime released;
    const struct byte_damage damage = next_damage(bus);
    const uint8_t address = bus->transfer.address ^ (uint8_t)(damage.flip >> 1);
    bus->master_reads = reading;
    bus->slaves_send = reading != ((damage.flip & 1u) != 0u);
    if (ends_the_transfer(bus, &damage)) {
        return;
    }
    const bool acknowledged = call_slaves(bus, address, &released) && !damage.nack;
    released += damage.stretch;
    if (bus->by_steps) {
        hold(bus, acknowledged ? BUS_ACKNOWLEDGED : BUS_NOT_ACKNOWLEDGED, released);
        return;
    }
    if (!acknowledged) {
        bus->result = TAXEL_I2C_NACK_ADDRESS;
        bus_send_stop(bus, released);
        return;
    }
    bus->index = 0;
    if (reading) {
        bus_next_byte(bus, BUS_READ, released);
    } else if (bus->transfer.write_size) {
        bus_next_byte(bus, BUS_WRITE, released);
    } else if (bus->slaves_send) {
        bus_collide(bus, TAXEL_I2C_BUS_ERROR);
    } else {
        after_writing(bus, released);
    }
}

static void end_write(struct bus *bus)
{
    bool acknowledged = false;
    vtime released = bus->next;
    const struct byte_damage damage = next_damage(bus);
    const uint8_t byte = (bus->by_steps ? bus->byte : bus->transfer.write_bytes[bus->index]) ^ damage.flip;
    if (ends_the_transfer(bus, &damage)) {
        return;
    }
    if (bus->slaves_send) {
        bus_collide(bus, TAXEL_I2C_ARBITRATION_LOST);
        return;
    }
    for (size_t i = 0; i < bus->slave_count; i++) {
        bool acknowledge = false;
        if (bus->slaves[i]->powered) {
            released = vtime_max(released, board_write(bus->slaves[i], bus->next, byte, &acknowledge));
        }
        acknowledged = acknowledged || acknowledge;
    }
    released += damage.stretch;
    bus->index++;
    if (bus->by_steps) {
        hold(bus, acknowledged && !damage.nack ? BUS_ACKNOWLEDGED : BUS_NOT_ACKNOWLEDGED, released);
    } else if (!acknowledged || damage.nack) {
        bus->result = TAXEL_I2C_NACK_DATA;
        bus_send_stop(bus, released);
    } else if (bus->index < bus->transfer.write_size) {
        bus_next_byte(bus, BUS_WRITE, released);
    } else {
        after_writing(bus, released);
    }
}

/* What the slaves put onto the line; called for writing, they take what they see there. */
static uint8_t line_byte(struct bus *bus, vtime *released)
{
    uint8_t line = 0xFF; /* open drain: a zero wins */
    for (size_t i = 0; i < bus->slave_count && !bus->let_go; i++) {
        uint8_t byte = 0xFF;
        bool acknowledge = false;
        if (!bus->slaves[i]->powered) {
            continue;
        }
        if (bus->slaves_send) {
            *released = vtime_max(*released, board_read(bus->slaves[i], bus->next, &byte));
        } else {
            *released = vtime_max(*released, board_write(bus->slaves[i], bus->next, byte, &acknowledge));
        }
        line &= byte;
    }
    return line;
}

static void end_read(struct bus *bus)
{
    vtime released = bus->next;
    const struct byte_damage damage = next_damage(bus);
    if (ends_the_transfer(bus, &damage)) {
        return;
    }
    const uint8_t line = line_byte(bus, &released) ^ damage.flip;
    bus->let_go = bus->let_go || damage.nack;
    bus->byte = bus_sda_is_held(bus) ? 0 : line;
    released += damage.stretch;
    if (bus->by_steps) {
        hold(bus, BUS_BYTE, released);
        return;
    }
    bus->transfer.read_bytes[bus->index++] = bus->byte;
    if (bus->transfer.counted && bus->index == 1u) {
        bus->transfer.read_size = 1u + taxel_i2c_counted_rest(&bus->transfer, bus->byte);
    }
    if (bus->index < bus->transfer.read_size) {
        bus_next_byte(bus, BUS_READ, released);
    } else {
        bus_send_stop(bus, released);
    }
}

static void end_stop(struct bus *bus)
{
    for (size_t i = 0; i < bus->slave_count; i++) {
        if (bus->slaves[i]->powered) {
            board_stop(bus->slaves[i], bus->next);
        }
    }
    if (bus_sda_is_held(bus)) {
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
        case BUS_HELD:
            return true;
        default:
            bus->event = bus_steps_end(bus);
            bus->busy += bus->next - bus->started;
            return true;
        }
    }
    return false;
}
