/* Measurement of one crossing with the CapSense block: a current source balances the charge that the TX line couples
 * into the RX line, and the block counts the clocks in which the source is on. */
#ifndef PSOC4_FRONT_END_H
#define PSOC4_FRONT_END_H

#include <stdint.h>

#include "generated/taxel_protocol.h"

/* Initialise the block. `tx_lines`, `rx_lines`: number of lines in use, in the order of pins.toml; `idac_codes`: a
 * current code for each RX line (0: the code of the scan settings applies), or NULL. */
void front_end_init(uint8_t tx_lines, uint8_t rx_lines, const uint8_t *idac_codes);
void front_end_configure(const struct taxel_scan_settings *settings);

/* Begin a conversion; front_end_on_conversion() follows. */
void front_end_start(uint8_t tx, uint8_t rx);

/* Defined by the image. Called from the interrupt. */
void front_end_on_conversion(uint16_t raw_count);

#endif
