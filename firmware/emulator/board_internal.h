/* Functions shared by the source files of a board: board_node.c (set-up and scan), board_power.c (power and boot),
 * board_slave.c (I2C). */
#ifndef EMULATOR_BOARD_INTERNAL_H
#define EMULATOR_BOARD_INTERNAL_H

#include "emulator/board_node.h"

/* Return the duration of CPU cycles under the board's clock rate. */
static inline vtime board_cycles_to_time(const struct board_node *board, unsigned count)
{
    return (vtime)(int64_t)(count * board->cycle);
}

/* board_node.c */

/* Begin an interrupt that is raised at `now` and occupies the CPU for `cycles`: first run the scan interrupts up to
 * `now`. Returns when the interrupt begins, which is later than `now` while the CPU is busy. */
vtime board_begin_interrupt(struct board_node *board, vtime now, unsigned cycles);

/* Return the raw count of the conversion that board->conversion_... describe. */
uint16_t board_run_conversion(struct board_node *board);

/* board_power.c */

/* Continue after the bootloader has run: start the application, hang, restart, or stay in the bootloader. */
void board_handle_boot_outcome(struct board_node *board, enum boot_outcome outcome);

/* Store the fault of an application whose scan has stalled, and reset the board by its watchdog, if these are due by
 * `until`. */
void board_run_stall(struct board_node *board, vtime until);

/* Process the bootloader's timeout and the watchdog up to `until`, for a board that runs no application. */
void board_advance_bootloader(struct board_node *board, vtime until);

/* Confirm an image on trial once it has scanned and a snapshot was read. */
void board_confirm_image(struct board_node *board, vtime now);

#endif
