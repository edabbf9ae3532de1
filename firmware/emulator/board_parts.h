/* What a board's own source files share: board_node.c (set-up, scan), board_life.c (power, boot), board_slave.c (bus). */
#ifndef EMULATOR_BOARD_PARTS_H
#define EMULATOR_BOARD_PARTS_H

#include "emulator/board_node.h"

/* board_node.c. Begin an interrupt: the scan's interrupts up to now have run, and this one waits until the CPU is free. Returns when. */
vtime board_enter(struct board_node *board, vtime now, unsigned cost);
vtime board_cycles(const struct board_node *board, unsigned count);
/* Of the conversion that board->conversion_... describes: its raw count. */
uint16_t board_convert(struct board_node *board);

/* board_life.c */
void board_after_boot(struct board_node *board, enum boot_node_outcome outcome);
/* What has happened in a board that runs no application: its bootloader has waited long enough, its watchdog has bitten. */
void board_catch_up(struct board_node *board, vtime until);
/* An image on trial that has scanned and was read works. */
void board_confirm(struct board_node *board, vtime now);

#endif
