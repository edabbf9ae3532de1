/* The I2C slave of a board: passes the events of the bus to the application, the bootloader or the executed image. */
#include "emulator/board_cortex.h"
#include "emulator/board_internal.h"
#include "emulator/board_original.h"
#include "emulator/base/costs.h"

#define CORRUPTED_BIT 0x10u

/* Execute a packet that the board's bootloader has received. */
static void run_bootloader(struct board_node *board, vtime now)
{
    if (board->program == PROGRAM_BOOTLOADER && board->boot->i2c.has_packet) {
        board_handle_boot_outcome(board, boot_node_run(board->boot, now));
    }
}

/* Return whether the board would acknowledge this I2C address now: power on, address equal (or the general call, for an
 * original board), and neither booting nor writing flash. Advances the board to `now`. */
bool board_can_respond(struct board_node *board, vtime now, uint8_t address)
{
    if (!board->is_powered) {
        return false;
    }
    if (board->psoc) {
        board_cortex_advance(board, now);
        const bool has_address = board->is_powered && psoc_i2c_matches_address(board->psoc, address);
        board->address = has_address ? address : board->address;
        return has_address;
    }
    if (board->original) {
        return board_original_can_respond(board, now, address);
    }
    if (board->program != PROGRAM_APPLICATION) {
        board_advance_bootloader(board, now);
        run_bootloader(board, now); /* processes a packet whose stop condition was lost */
    }
    if (!board->is_powered || board->address != address) {
        return false;
    }
    if (board->program == PROGRAM_APPLICATION) {
        return now >= board->boot_end && now >= board->flash_busy_until;
    }
    return board->program == PROGRAM_BOOTLOADER && now >= board->boot->reset_at && now >= board->boot->busy_until;
}

/* Add the effect of a fault on this board to the fault log, if there is one. */
static void log_fault(struct board_node *board, vtime now, enum fault_kind kind)
{
    if (board->log) {
        fault_log_add(board->log, now, kind, board->description->address);
    }
}

/* Address the board on the bus. Injected faults apply first. Returns the time at which the board releases SCL: the
 * emulated chip, an original board, the bootloader and the application (with the measured cost of its interrupt) hold
 * SCL for different times. *acknowledge becomes whether the board acknowledges. */
vtime board_on_address(struct board_node *board, vtime now, uint8_t address, bool reading, bool *acknowledge)
{
    if (board->nacks_left) {
        board->nacks_left--;
        log_fault(board, now, FAULT_NACK);
        *acknowledge = false;
        return now;
    }
    if (silent_loses_addressing(&board->effects->silent, board->board_index, (double)now / (double)VTIME_SECOND,
                                &board->contact)) {
        *acknowledge = false;
        return now;
    }
    if (board->psoc) {
        const vtime released = psoc_i2c_on_address(board->psoc, now, reading, acknowledge) + board->address_stretch;
        board->address_stretch = 0;
        return released;
    }
    if (board->original) {
        const vtime released = now + board->address_stretch;
        board->address_stretch = 0;
        *acknowledge = board_original_on_address(board, now, address, reading);
        return released;
    }
    if (board->program != PROGRAM_APPLICATION) {
        *acknowledge = taxel_boot_i2c_on_address(&board->boot->i2c, reading);
        return now;
    }
    const vtime begin = board_begin_interrupt(board, now, reading ? COST_SLAVE_READ : COST_SLAVE_WRITE);
    const unsigned hold_cycles = reading ? COST_SLAVE_READ_HOLD : COST_SLAVE_WRITE_HOLD;
    const vtime ready = begin + board_cycles_to_time(board, hold_cycles) + board->address_stretch;
    board->address_stretch = 0;
    board->fifo_fill = COST_SLAVE_FIFO - 1u;
    *acknowledge = taxel_sensor_on_address(&board->sensor, reading);
    return ready;
}

/* Deliver a byte that the master has written to the board. Returns the time at which the board releases SCL;
 * *acknowledge becomes whether it acknowledges. */
vtime board_on_write(struct board_node *board, vtime now, uint8_t byte, bool *acknowledge)
{
    if (board->psoc) {
        board_cortex_advance(board, now);
        return psoc_i2c_on_write(board->psoc, now, byte, acknowledge);
    }
    if (board->original) {
        board_original_advance(board, now);
        *acknowledge = original_board_on_write(board->original, byte);
        return now;
    }
    if (board->program != PROGRAM_APPLICATION) {
        *acknowledge = taxel_boot_i2c_on_write(&board->boot->i2c, byte);
        return now;
    }
    const vtime begin = board_begin_interrupt(board, now, COST_SLAVE_BYTE);
    *acknowledge = taxel_sensor_on_write(&board->sensor, byte);
    return begin + board_cycles_to_time(board, COST_SLAVE_BYTE_HOLD);
}

/* Read a byte from the board. Returns the time at which the board releases SCL. An injected fault may flip a bit. */
vtime board_on_read(struct board_node *board, vtime now, uint8_t *byte)
{
    vtime released = now;
    if (board->psoc) {
        board_cortex_advance(board, now);
        released = psoc_i2c_on_read(board->psoc, now, byte);
    } else if (board->original) {
        board_original_advance(board, now);
        *byte = original_board_on_read(board->original);
    } else if (board->program != PROGRAM_APPLICATION) {
        *byte = taxel_boot_i2c_on_read(&board->boot->i2c);
    } else {
        if (--board->fifo_fill < COST_SLAVE_FIFO / 2u) { /* the interrupt that refills the FIFO */
            (void)board_begin_interrupt(board, now, COST_SLAVE_REFILL);
            board->fifo_fill = COST_SLAVE_FIFO;
        }
        *byte = taxel_sensor_on_read(&board->sensor);
    }
    if (board->corrupt_bytes_left) {
        board->corrupt_bytes_left--;
        *byte ^= CORRUPTED_BIT;
        if (!board->corrupt_bytes_left) {
            /* only the last byte, because one entry per byte would fill the log */
            log_fault(board, now, FAULT_CORRUPT);
        }
    }
    return released;
}

/* Handle a start or stop condition at a wrong position, which ends the transfer of this board. */
void board_on_bus_error(struct board_node *board, vtime now)
{
    if (board->psoc) {
        board_cortex_advance(board, now);
        psoc_i2c_on_bus_error(board->psoc);
        return;
    }
    if (board->original) {
        board_original_advance(board, now);
        original_board_on_stop(board->original, now);
        return;
    }
    if (board->program != PROGRAM_APPLICATION) {
        taxel_boot_i2c_on_bus_error(&board->boot->i2c);
        return;
    }
    (void)board_begin_interrupt(board, now, COST_SLAVE_STOP);
    taxel_sensor_on_bus_error(&board->sensor);
}

/* Handle a stop condition: the firmware executes the bytes written, and a requested restart takes place now. */
void board_on_stop(struct board_node *board, vtime now)
{
    if (board->psoc) {
        board_cortex_advance(board, now);
        psoc_i2c_on_stop(board->psoc);
        return;
    }
    if (board->original) {
        board_original_advance(board, now);
        original_board_on_stop(board->original, now);
        return;
    }
    if (board->program != PROGRAM_APPLICATION) {
        taxel_boot_i2c_on_stop(&board->boot->i2c);
        run_bootloader(board, now);
        return;
    }
    (void)board_begin_interrupt(board, now, COST_SLAVE_STOP);
    taxel_sensor_on_stop(&board->sensor);
    if (board->restart_requested) {
        board_set_power(board, true, now, TAXEL_RESET_CAUSE_COMMAND);
        return;
    }
    board_confirm_image(board, now);
}
