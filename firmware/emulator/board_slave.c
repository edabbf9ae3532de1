/* What the bus asks of a board: its application answers, or its bootloader. */
#include "emulator/board_cortex.h"
#include "emulator/board_parts.h"
#include "emulator/costs.h"

#define CORRUPTED_BIT 0x10u

static void run_bootloader(struct board_node *board, vtime now)
{
    if (board->runs == RUNS_BOOTLOADER && board->boot->i2c.has_packet) {
        board_after_boot(board, boot_node_run(board->boot, now));
    }
}

bool board_answers(struct board_node *board, vtime now, uint8_t address)
{
    if (!board->powered) {
        return false;
    }
    if (board->psoc) {
        board_cortex_advance(board, now);
        const bool listens = board->powered && psoc_i2c_listens(board->psoc, address);
        board->address = listens ? address : board->address;
        return listens;
    }
    if (board->runs != RUNS_APPLICATION) {
        board_catch_up(board, now);
        run_bootloader(board, now); /* a packet whose master went away before its stop, found when it was next addressed */
    }
    if (!board->powered || board->address != address) {
        return false;
    }
    if (board->runs == RUNS_APPLICATION) {
        return now >= board->boot_end && now >= board->flash_until;
    }
    return board->runs == RUNS_BOOTLOADER && now >= board->boot->reset_at && now >= board->boot->busy_until;
}

static void note(struct board_node *board, vtime now, enum fault_kind kind)
{
    if (board->log) {
        fault_log_add(board->log, now, kind, board->description->address);
    }
}

vtime board_address(struct board_node *board, vtime now, bool reading, bool *acknowledge)
{
    if (board->nacks) {
        board->nacks--;
        note(board, now, FAULT_NACK);
        *acknowledge = false;
        return now;
    }
    if (silent_loses(&board->effects->silent, board->index, (double)now / (double)VTIME_SECOND, &board->contact)) {
        *acknowledge = false;
        return now;
    }
    if (board->psoc) {
        const vtime released = psoc_i2c_address(board->psoc, now, reading, acknowledge) + board->stretch;
        board->stretch = 0;
        return released;
    }
    if (board->runs != RUNS_APPLICATION) {
        *acknowledge = taxel_boot_i2c_on_address(&board->boot->i2c, reading);
        return now;
    }
    const vtime begin = board_enter(board, now, reading ? COST_SLAVE_READ : COST_SLAVE_WRITE);
    const vtime ready = begin + board_cycles(board, reading ? COST_SLAVE_READ_HOLD : COST_SLAVE_WRITE_HOLD) + board->stretch;
    board->stretch = 0;
    board->unsent = COST_SLAVE_FIFO - 1u;
    *acknowledge = taxel_sensor_on_address(&board->sensor, reading);
    return ready;
}

vtime board_write(struct board_node *board, vtime now, uint8_t byte, bool *acknowledge)
{
    if (board->psoc) {
        board_cortex_advance(board, now);
        return psoc_i2c_written(board->psoc, now, byte, acknowledge);
    }
    if (board->runs != RUNS_APPLICATION) {
        *acknowledge = taxel_boot_i2c_on_write(&board->boot->i2c, byte);
        return now;
    }
    const vtime begin = board_enter(board, now, COST_SLAVE_BYTE);
    *acknowledge = taxel_sensor_on_write(&board->sensor, byte);
    return begin + board_cycles(board, COST_SLAVE_BYTE_HOLD);
}

vtime board_read(struct board_node *board, vtime now, uint8_t *byte)
{
    vtime released = now;
    if (board->psoc) {
        board_cortex_advance(board, now);
        released = psoc_i2c_read(board->psoc, now, byte);
    } else if (board->runs != RUNS_APPLICATION) {
        *byte = taxel_boot_i2c_on_read(&board->boot->i2c);
    } else {
        if (--board->unsent < COST_SLAVE_FIFO / 2u) { /* it is filled again */
            (void)board_enter(board, now, COST_SLAVE_REFILL);
            board->unsent = COST_SLAVE_FIFO;
        }
        *byte = taxel_sensor_on_read(&board->sensor);
    }
    if (board->corrupt_bytes) {
        board->corrupt_bytes--;
        *byte ^= CORRUPTED_BIT;
        if (!board->corrupt_bytes) {
            note(board, now, FAULT_CORRUPT); /* the last one: each of them would fill the log */
        }
    }
    return released;
}

void board_bus_error(struct board_node *board, vtime now)
{
    if (board->psoc) {
        board_cortex_advance(board, now);
        psoc_i2c_bus_error(board->psoc);
        return;
    }
    if (board->runs != RUNS_APPLICATION) {
        taxel_boot_i2c_on_bus_error(&board->boot->i2c);
        return;
    }
    (void)board_enter(board, now, COST_SLAVE_STOP);
    taxel_sensor_on_bus_error(&board->sensor);
}

void board_stop(struct board_node *board, vtime now)
{
    if (board->psoc) {
        board_cortex_advance(board, now);
        psoc_i2c_stopped(board->psoc);
        return;
    }
    if (board->runs != RUNS_APPLICATION) {
        taxel_boot_i2c_on_stop(&board->boot->i2c);
        run_bootloader(board, now);
        return;
    }
    (void)board_enter(board, now, COST_SLAVE_STOP);
    taxel_sensor_on_stop(&board->sensor);
    if (board->restart_wanted) {
        board_power(board, true, now, TAXEL_RESET_CAUSE_COMMAND);
        return;
    }
    board_confirm(board, now);
}
