#include "emulator/bus_internal.h"

#include <string.h>

/* Initialise an idle I2C bus with the boards of the world; `scl_hz`: clock rate in Hz. */
void bus_init(struct bus *bus, struct board_node *boards, size_t board_count, double scl_hz, struct fault_log *log)
{
    memset(bus, 0, sizeof *bus);
    bus->boards = boards;
    bus->board_count = board_count;
    bus->scl_period = (vtime)((double)VTIME_SECOND / scl_hz);
    bus->next = VTIME_NEVER;
    bus->scl_high = bus->sda_high = true;
    bus->log = log;
}

/* Return whether no device holds the clock line low at the virtual time `now`. */
bool bus_is_scl_high(const struct bus *bus, vtime now)
{
    return bus->scl_high && now >= bus_scl_held_until(bus);
}

/* Return whether no device holds the data line low. */
bool bus_is_sda_high(const struct bus *bus)
{
    return bus->sda_high && !bus_sda_is_held(bus);
}

/* Set the levels of SCL and SDA that the hub drives during bus recovery. Each falling edge of SCL brings a board that
 * holds SDA one clock closer to releasing it. */
void bus_drive_lines(struct bus *bus, bool scl_high, bool sda_high)
{
    if (bus->scl_high && !scl_high) {
        for (size_t i = 0; i < bus->board_count; i++) {
            if (bus->boards[i].sda_hold_clocks) {
                bus->boards[i].sda_hold_clocks--;
            }
        }
    }
    bus->scl_high = scl_high;
    bus->sda_high = sda_high;
}

/* Begin a transfer on the free bus: the first event is the end of the address byte. If a line is held low, the transfer
 * ends with TAXEL_I2C_BUSY. */
void bus_begin_transfer(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now)
{
    bus->master = master;
    bus->transfer = *transfer;
    bus->index = 0;
    bus->byte_number = 0;
    bus->slave_count = 0;
    bus->slaves_transmit = false;
    bus->slaves_released = false;
    bus->transfer_begin = now;
    bus->is_bytewise = false;
    if (bus_sda_is_held(bus) || now < bus_scl_held_until(bus)) {
        bus->result = TAXEL_I2C_BUSY;
        bus->phase = BUS_DONE;
        bus->next = now + bus->scl_period;
        return;
    }
    bus->result = TAXEL_I2C_OK;
    bus->phase = transfer->write_size || !transfer->read_size ? BUS_ADDRESS_WRITE : BUS_ADDRESS_READ;
    /* start condition, then the address byte */
    bus->next = now + bus->scl_period + BUS_CLOCKS_PER_BYTE * bus->scl_period;
}

/* Begin a transfer, or let it wait until the other master has released the bus. */
void bus_start_transfer(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now)
{
    if (bus->phase != BUS_IDLE && bus->master != master) {
        bus->is_waiting[master] = true;
        bus->waiting_transfer[master] = *transfer;
        return;
    }
    bus_begin_transfer(bus, master, transfer, now);
}

/* End the current master's use of the bus and begin the transfer for which the other master waits. hub_waits_bytewise:
 * the hub waits for a transfer that it controls byte by byte. */
void bus_release(struct bus *bus, vtime now)
{
    const enum bus_master other = bus->master == BUS_HUB ? BUS_ADAPTER : BUS_HUB;
    bus->phase = BUS_IDLE;
    bus->next = VTIME_NEVER;
    if (bus->is_waiting[other] && other == BUS_HUB && bus->hub_waits_bytewise) {
        bus->is_waiting[other] = false;
        bus_bytewise_begin(bus, bus->waiting_address_byte, now);
    } else if (bus->is_waiting[other]) {
        bus->is_waiting[other] = false;
        bus_begin_transfer(bus, other, &bus->waiting_transfer[other], now);
    }
}

/* Abort a master's transfer, in progress or waiting, and release both lines. */
void bus_abort(struct bus *bus, enum bus_master master, vtime now)
{
    bus->is_waiting[master] = false;
    bus->scl_high = bus->sda_high = true;
    if (bus->master == master) {
        bus_release(bus, now);
    }
}

/* Report the result of a byte to a bytewise master, which holds SCL low until its next command. */
static void finish_command(struct bus *bus, enum bus_event event, vtime released)
{
    bus->phase = BUS_HELD;
    bus->event = event;
    bus->next = vtime_max(bus->next, vtime_max(released, bus_scl_held_until(bus)));
}

/* Return the virtual time at which the master continues after a byte whose clock line the slaves have released at
 * `released`. A native hub also holds the clock line low for `byte_hold`, in its interrupt. */
static vtime resume_time(const struct bus *bus, vtime released)
{
    const vtime hold = bus->master == BUS_HUB && !bus->is_bytewise ? bus->byte_hold : 0;
    return bus_add_time(vtime_max(bus->next, vtime_max(released, bus_scl_held_until(bus))), hold);
}

/* Start a byte of 9 clocks in the given phase; it begins when the clock line, released at time `released`,
 * rises. */
void bus_begin_byte(struct bus *bus, enum bus_phase phase, vtime released)
{
    bus->phase = phase;
    bus->next = bus_add_time(resume_time(bus, released), BUS_CLOCKS_PER_BYTE * bus->scl_period);
}

/* Start a stop condition, one clock after the clock line, released at time `released`, rises. */
void bus_begin_stop(struct bus *bus, vtime released)
{
    bus->phase = BUS_STOP;
    bus->next = bus_add_time(resume_time(bus, released), bus->scl_period);
}

/* End the transfer with `result`, because the master has lost the bus in the middle of it; there is no stop
 * condition. */
static void lose_bus(struct bus *bus, int8_t result)
{
    for (size_t i = 0; i < bus->slave_count; i++) {
        if (bus->slaves[i]->is_powered) {
            board_on_bus_error(bus->slaves[i], bus->next);
        }
    }
    bus->slave_count = 0;
    bus->result = result;
    bus->phase = BUS_DONE;
    bus->next += bus->scl_period;
}

/* Count a byte of the transfer and return the damage that injected faults do to it. A brown-out resets the addressed
 * board. */
static struct byte_damage apply_byte_faults(struct bus *bus)
{
    const unsigned position = bus->byte_number++;
    bus->byte_count++;
    if (!bus->faults.count) {
        return (struct byte_damage){.nack = false};
    }
    const struct byte_damage damage =
        bus_faults_apply(&bus->faults, bus->transfer.address, position, bus->next, bus->log);
    for (size_t i = 0; damage.brown_out && i < bus->board_count; i++) {
        struct board_node *board = &bus->boards[i];
        if (board->address == bus->transfer.address && board->is_powered) {
            board_advance(board, bus->next); /* so that its measurements do not depend on when it was last advanced */
            board_set_power(board, false, bus->next, TAXEL_RESET_CAUSE_BROWN_OUT);
            board_set_power(board, true, bus->next + damage.off_time, TAXEL_RESET_CAUSE_BROWN_OUT);
            bus->slave_count = 0; /* the board was the only slave addressed */
        }
    }
    return damage;
}

/* End the transfer if the damage of a byte is a lost arbitration or a bus error. Returns whether it has ended. */
static bool abort_if_bus_lost(struct bus *bus, const struct byte_damage *damage)
{
    if (damage->arbitration || damage->bus_error) {
        lose_bus(bus, damage->arbitration ? TAXEL_I2C_ARBITRATION_LOST : TAXEL_I2C_BUS_ERROR);
        return true;
    }
    return false;
}

/* Send an address byte to all boards; each board receives the byte as the wiring of its branch delivers it. Returns
 * whether a slave acknowledges; *released is the time at which all slaves have released SCL. */
static bool address_slaves(struct bus *bus, uint8_t address_byte, vtime *released)
{
    *released = bus->next;
    bus->slave_count = 0;
    bus->slaves_transmit = address_byte & 1u;
    for (size_t i = 0; i < bus->board_count && bus->slave_count < BUS_SLAVES_MAX; i++) {
        struct board_node *board = &bus->boards[i];
        bool acknowledge = false;
        uint8_t received = address_byte;
        if (bus->wiring.description) {
            if (!bus_wiring_connects(&bus->wiring, board->description->address)) {
                continue;
            }
            received = bus_wiring_deliver_to_board(&bus->wiring, board->description->address, address_byte);
        }
        if (!board_can_respond(board, bus->next, received >> 1)) {
            continue;
        }
        *released =
            vtime_max(*released, board_on_address(board, bus->next, received >> 1, received & 1u, &acknowledge));
        if (acknowledge) {
            bus->slaves_transmit = received & 1u; /* of several boards, the last one decides */
            bus->slaves[bus->slave_count++] = board;
        }
    }
    return bus->slave_count > 0;
}

/* Return whether a slave has power and the wiring connects it to the hub. */
static bool is_connected(const struct bus *bus, const struct board_node *slave)
{
    return slave->is_powered && bus_wiring_connects(&bus->wiring, slave->description->address);
}

/* Continue a transfer after its last written byte: with a read, or with a stop condition. */
static void continue_after_write(struct bus *bus, vtime released)
{
    if (bus->transfer.read_size) {
        bus_begin_byte(bus, BUS_ADDRESS_READ, released + bus->scl_period); /* repeated start */
    } else {
        bus_begin_stop(bus, released);
    }
}

/* End a transfer in which master and board drive the bus at the same time: the master loses the bus and the boards
 * remain in the middle of a byte, holding SDA until it is clocked out. */
void bus_handle_collision(struct bus *bus, int8_t result)
{
    for (size_t i = 0; i < bus->slave_count; i++) {
        bus->slaves[i]->sda_hold_clocks = BUS_CLOCKS_PER_BYTE - 1u;
        bus->lines_may_be_held = true;
    }
    lose_bus(bus, result);
}

/* End an address byte: address the boards that match, and continue with data, or with a stop condition after a NACK.
 * Injected faults may change the address or its read bit. */
static void end_address(struct bus *bus, bool reading)
{
    vtime released;
    const struct byte_damage damage = apply_byte_faults(bus);
    const unsigned read_bit = reading ? 1u : 0u;
    const uint8_t address_byte = (uint8_t)(((unsigned)bus->transfer.address << 1) | read_bit) ^ damage.flip;
    bus->master_reads = reading;
    if (abort_if_bus_lost(bus, &damage)) {
        return;
    }
    const bool acknowledged = address_slaves(bus, address_byte, &released) && !damage.nack;
    released += damage.stretch;
    if (bus->is_bytewise) {
        finish_command(bus, acknowledged ? BUS_ACKNOWLEDGED : BUS_NOT_ACKNOWLEDGED, released);
        return;
    }
    if (!acknowledged) {
        bus->result = TAXEL_I2C_NACK_ADDRESS;
        bus_begin_stop(bus, released);
        return;
    }
    bus->index = 0;
    if (reading) {
        bus_begin_byte(bus, BUS_READ, released);
    } else if (bus->transfer.write_size) {
        bus_begin_byte(bus, BUS_WRITE, released);
    } else if (bus->slaves_transmit) {
        bus_handle_collision(bus, TAXEL_I2C_BUS_ERROR);
    } else {
        continue_after_write(bus, released);
    }
}

/* End a byte from the master: deliver it to all addressed boards. SDA is a wired AND, so one acknowledge is enough; a
 * board that transmits meanwhile causes lost arbitration. */
static void end_write(struct bus *bus)
{
    bool acknowledged = false;
    vtime released = bus->next;
    const struct byte_damage damage = apply_byte_faults(bus);
    const uint8_t byte = (bus->is_bytewise ? bus->byte : bus->transfer.write_bytes[bus->index]) ^ damage.flip;
    if (abort_if_bus_lost(bus, &damage)) {
        return;
    }
    if (bus->slaves_transmit) {
        bus_handle_collision(bus, TAXEL_I2C_ARBITRATION_LOST);
        return;
    }
    for (size_t i = 0; i < bus->slave_count; i++) {
        bool acknowledge = false;
        if (is_connected(bus, bus->slaves[i])) {
            const uint8_t received =
                bus_wiring_deliver_to_board(&bus->wiring, bus->slaves[i]->description->address, byte);
            released = vtime_max(released, board_on_write(bus->slaves[i], bus->next, received, &acknowledge));
        }
        acknowledged = acknowledged || acknowledge;
    }
    released += damage.stretch;
    bus->index++;
    if (bus->is_bytewise) {
        finish_command(bus, acknowledged && !damage.nack ? BUS_ACKNOWLEDGED : BUS_NOT_ACKNOWLEDGED, released);
    } else if (!acknowledged || damage.nack) {
        bus->result = TAXEL_I2C_NACK_DATA;
        bus_begin_stop(bus, released);
    } else if (bus->index < bus->transfer.write_size) {
        bus_begin_byte(bus, BUS_WRITE, released);
    } else {
        continue_after_write(bus, released);
    }
}

/* Return the byte that the slaves transmit; *released is raised to the time at which all of them have released SCL.
 * Slaves that were addressed for writing receive the byte on the line instead. */
static uint8_t transmit_from_slaves(struct bus *bus, vtime *released)
{
    uint8_t line = 0xFF; /* open drain: a zero wins */
    for (size_t i = 0; i < bus->slave_count && !bus->slaves_released; i++) {
        uint8_t byte = 0xFF;
        bool acknowledge = false;
        if (!is_connected(bus, bus->slaves[i])) {
            continue;
        }
        if (bus->slaves_transmit) {
            *released = vtime_max(*released, board_on_read(bus->slaves[i], bus->next, &byte));
            byte = bus_wiring_deliver_to_hub(&bus->wiring, bus->slaves[i]->description->address, byte);
        } else {
            *released = vtime_max(*released, board_on_write(bus->slaves[i], bus->next, byte, &acknowledge));
        }
        line &= byte;
    }
    return line;
}

/* End a byte to the master: the wired AND of all transmitting boards, 0 while SDA is held low. The first byte of a
 * length-prefixed transfer sets the number of bytes that follow. */
static void end_read(struct bus *bus)
{
    vtime released = bus->next;
    const struct byte_damage damage = apply_byte_faults(bus);
    if (abort_if_bus_lost(bus, &damage)) {
        return;
    }
    const uint8_t line = transmit_from_slaves(bus, &released) ^ damage.flip;
    bus->slaves_released = bus->slaves_released || damage.nack;
    bus->byte = bus_sda_is_held(bus) ? 0 : line;
    released += damage.stretch;
    if (bus->is_bytewise) {
        finish_command(bus, BUS_BYTE, released);
        return;
    }
    bus->transfer.read_bytes[bus->index++] = bus->byte;
    if (bus->transfer.length_prefixed && bus->index == 1u) {
        bus->transfer.read_size = 1u + taxel_i2c_bytes_after_length(&bus->transfer, bus->byte);
    }
    if (bus->index < bus->transfer.read_size) {
        bus_begin_byte(bus, BUS_READ, released);
    } else {
        bus_begin_stop(bus, released);
    }
}

/* End a stop condition: inform the addressed boards. If SDA is held low, the result is TAXEL_I2C_BUS_ERROR. */
static void end_stop(struct bus *bus)
{
    for (size_t i = 0; i < bus->slave_count; i++) {
        if (bus->slaves[i]->is_powered) {
            board_on_stop(bus->slaves[i], bus->next);
        }
    }
    if (bus_sda_is_held(bus)) {
        bus->result = TAXEL_I2C_BUS_ERROR; /* SDA stays low, so that there is no stop condition */
    }
    bus->slave_count = 0;
    bus->phase = BUS_DONE;
}

/* Process the bus events until virtual time `horizon`. Returns whether a transfer has ended, or a command of a bytewise
 * master, at the time bus->next. */
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
            bus->event = bus_bytewise_result(bus);
            bus->busy_time += bus->next - bus->transfer_begin;
            return true;
        }
    }
    return false;
}
