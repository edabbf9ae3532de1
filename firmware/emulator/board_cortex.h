/* A sensor board whose image is executed (psoc4200/), instead of being this program's own firmware. Front end, skin, flash, faults and
 * power are those of every board; board_node.c, board_life.c and board_slave.c hand over to here where a native board would run. */
#ifndef EMULATOR_BOARD_CORTEX_H
#define EMULATOR_BOARD_CORTEX_H

#include "emulator/board_node.h"

/* For a board whose description has an image. Returns 0, or -1 without memory. */
int board_cortex_open(struct board_node *board, const struct world_description *world);
void board_cortex_close(struct board_node *board);

void board_cortex_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause);
void board_cortex_advance(struct board_node *board, vtime until);

#endif
