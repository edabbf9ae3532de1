#include "emulator/board_original.h"

#include <stdio.h>
#include <stdlib.h>

#include "emulator/board_internal.h"

#define GENERAL_CALL_ADDRESS 0u

/* Create the original firmware of a board, and set up its front end with the world's scan settings. Returns 0, or -1
 * after an error line on stderr. */
int board_original_open(struct board_node *board, const struct world_description *world)
{
    board->original = malloc(sizeof *board->original);
    if (!board->original) {
        fprintf(stderr, "board 0x%02X: out of memory for the original firmware\n", board->description->address);
        return -1;
    }
    original_board_init(board->original, board->description->address, (uint8_t)board->description->taxel_count,
                        &world->original);
    front_end_configure(&board->front_end, &world->scan, board->clock_rate);
    if (board->electronics) {
        electronics_configure(board->electronics);
    }
    board->address = board->description->address;
    board->program = PROGRAM_APPLICATION;
    return 0;
}

/* Free the original firmware of a board; does nothing for other boards. */
void board_original_close(struct board_node *board)
{
    free(board->original);
    board->original = NULL;
}

/* Switch the power of the board off and, if `on`, on again at `now`. The first scan begins after the boot time. */
void board_original_set_power(struct board_node *board, bool on, vtime now)
{
    boot_node_power_off(board->boot, now);
    if (on) {
        board->boot_end = now + (vtime)(board->description->boot_ms * (double)VTIME_MS);
        original_board_reset(board->original, board->boot_end,
                             board->front_end.conversion_time + board->front_end.settle_time);
    }
}

/* Compute the raw count of the taxel whose conversion ends next. */
static uint16_t run_conversion(struct board_node *board)
{
    const uint8_t taxel = board->original->scan_taxel;
    board->conversion_taxel = taxel;
    board->conversion_tx = board->tx_of_taxel[taxel];
    board->conversion_rx = board->rx_of_taxel[taxel];
    board->is_first_of_scan = taxel == 0;
    board->conversion_end = board->original->conversion_end;
    const uint16_t raw = board_run_conversion(board);
    board->conversion_end = VTIME_NEVER;
    return raw;
}

/* Execute conversions, and copies of counts to the read buffer word by word, in order of time up to `until`. */
void board_original_advance(struct board_node *board, vtime until)
{
    struct original_board *original = board->original;
    while (board->is_powered && original_board_next_event(original) <= until) {
        if (original_board_is_converting(original)) {
            original_board_on_conversion(original, run_conversion(board));
        } else {
            original_board_copy_word(original);
        }
    }
}

/* Return whether the board has booted and this address is its own or the general call address. */
bool board_original_can_respond(struct board_node *board, vtime now, uint8_t address)
{
    board_original_advance(board, now);
    return now >= board->boot_end && (address == board->address || address == GENERAL_CALL_ADDRESS);
}

/* Begin a transfer with this board. Returns whether the board acknowledges; it refuses to be read at the general call
 * address. */
bool board_original_on_address(struct board_node *board, vtime now, uint8_t address, bool reading)
{
    board_original_advance(board, now);
    if (address == GENERAL_CALL_ADDRESS && reading) {
        return false; /* reserved by the I2C specification (START byte) */
    }
    original_board_on_address(board->original);
    return true;
}
