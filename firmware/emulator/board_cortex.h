/* A sensor board that executes a firmware image on an emulated PSoC 4200 (psoc4/), in place of the natively compiled
 * firmware.
 *
 * Front end, skin, flash, faults and power are the same as for a native board. board_node.c, board_power.c and
 * board_slave.c call these functions for a board whose `psoc` is not NULL. */
#ifndef EMULATOR_BOARD_CORTEX_H
#define EMULATOR_BOARD_CORTEX_H

#include "emulator/board_node.h"

/* Create the emulated chip of a board whose description has an image. Returns 0, or -1 after an error line on stderr
 * (out of memory). */
int board_cortex_open(struct board_node *board, const struct world_description *world);
void board_cortex_close(struct board_node *board);

void board_cortex_set_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause);

/* Execute the image up to `until`. */
void board_cortex_advance(struct board_node *board, vtime until);

#endif
