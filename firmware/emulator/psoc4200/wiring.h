/* Pins of the TX and RX lines, from boards/psoc4200/pins.toml (checked by a test). Port in the high half of a byte, pin
 * number in the low half. */
#ifndef PSOC4200_WIRING_H
#define PSOC4200_WIRING_H

#include <stdint.h>

#define WIRING_TX_LINES 13u
#define WIRING_RX_LINES 12u
#define WIRING_RTS 0x06u

static const uint8_t wiring_tx[WIRING_TX_LINES] = {
    0x20, 0x21, 0x22, 0x23, 0x24, 0x25, 0x26, 0x27, 0x30, 0x31, 0x34, 0x35, 0x36,
};
static const uint8_t wiring_rx[WIRING_RX_LINES] = {
    0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x10, 0x11, 0x12, 0x13,
};

#endif
