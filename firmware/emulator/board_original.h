/* A sensor board that behaves as an original board (original/), in place of the project's own firmware.
 *
 * Front end, skin, faults and effects are the same as for a native board; there is no bootloader. board_node.c,
 * board_power.c and board_slave.c call these functions for a board whose `original` is not NULL. */
#ifndef EMULATOR_BOARD_ORIGINAL_H
#define EMULATOR_BOARD_ORIGINAL_H

#include "emulator/board_node.h"

/* Create the original firmware of a board, in a world with `protocol original`. Returns 0, or -1 after an error line on
 * stderr (out of memory). */
int board_original_open(struct board_node *board, const struct world_description *world);
void board_original_close(struct board_node *board);

/* Switch the power on (or reset) or off. The application starts `boot_ms` after power-up or reset. */
void board_original_set_power(struct board_node *board, bool on, vtime now);

/* Execute conversions and copies up to `until`. */
void board_original_advance(struct board_node *board, vtime until);

/* Return whether the board acknowledges this address: its own, or for writing the general call address 0. */
bool board_original_can_respond(struct board_node *board, vtime now, uint8_t address);
bool board_original_on_address(struct board_node *board, vtime now, uint8_t address, bool reading);

#endif
