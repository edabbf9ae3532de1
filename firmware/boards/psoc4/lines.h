/* TX and RX lines of a board: one of each takes part in a conversion, all others are held low. */
#ifndef PSOC4_LINES_H
#define PSOC4_LINES_H

#include <stdint.h>

/* Hold the first `tx_lines` and `rx_lines` of pins.toml low; a board with one TX line uses all its lines. */
void lines_init(uint8_t tx_lines, uint8_t rx_lines);

/* Connect the TX line of a crossing to the sense clock and its RX line to analog bus A. Returns the number of the RX
 * line in pins.toml. */
uint8_t lines_connect(uint8_t tx, uint8_t rx);

#endif
