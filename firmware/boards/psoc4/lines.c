#include "boards/psoc4/lines.h"

#include "board_pins.h"

#define NO_LINE 0xFFu

static const uint8_t tx_pins[BOARD_TX_LINES] = BOARD_TX_PINS;
static const uint8_t rx_pins[BOARD_RX_LINES] = BOARD_RX_PINS;

static struct {
    uint8_t tx, rx; /* connected lines, or NO_LINE */
} connected;

/* Drive one pin low as a push-pull output: the state of a TX or RX line that takes no part in a conversion. */
static void hold_low(uint8_t pin)
{
    pin_connect(pin, PIN_MODE_STRONG, PIN_GPIO);
}

/* Hold the first `tx_lines` TX lines and `rx_lines` RX lines of pins.toml low, and the pins of BOARD_LOW_PINS. A board
 * with one TX line (BOARD_RX_PER_ROW) holds all its lines low: its rows are groups of RX lines. */
void lines_init(uint8_t tx_lines, uint8_t rx_lines)
{
    connected.tx = NO_LINE;
    connected.rx = NO_LINE;
#ifdef BOARD_RX_PER_ROW
    tx_lines = BOARD_TX_LINES;
    rx_lines = BOARD_RX_LINES;
#endif
    for (uint8_t line = 0; line < tx_lines && line < BOARD_TX_LINES; line++) {
        hold_low(tx_pins[line]);
    }
    for (uint8_t line = 0; line < rx_lines && line < BOARD_RX_LINES; line++) {
        hold_low(rx_pins[line]);
    }
#ifdef BOARD_LOW_PINS
    static const uint8_t low_pins[] = BOARD_LOW_PINS;
    for (uint8_t i = 0; i < sizeof low_pins; i++) {
        hold_low(low_pins[i]);
    }
#endif
}

/* Connect TX line number `line` to the sense clock; the previous TX line is held low again. */
static void connect_tx(uint8_t line)
{
    if (line == connected.tx || line >= BOARD_TX_LINES) {
        return;
    }
    if (connected.tx != NO_LINE) {
        hold_low(tx_pins[connected.tx]);
    }
    pin_connect(tx_pins[line], PIN_MODE_STRONG, PIN_CSD_SENSE);
    connected.tx = line;
}

/* Connect RX line number `line` to the analog bus of the capacitance converter (CSD); the previous RX line is held
 * low again. */
static void connect_rx(uint8_t line)
{
    if (line == connected.rx || line >= BOARD_RX_LINES) {
        return;
    }
    if (connected.rx != NO_LINE) {
        hold_low(rx_pins[connected.rx]);
    }
    pin_connect(rx_pins[line], PIN_MODE_ANALOG, PIN_AMUX_A);
    connected.rx = line;
}

/* Connect the TX and RX line of a crossing for a conversion. Returns the number of the RX line in pins.toml. */
uint8_t lines_connect(uint8_t tx, uint8_t rx)
{
#ifdef BOARD_RX_PER_ROW /* a board with one TX line: a row of the register map is a group of RX lines */
    rx = (uint8_t)(rx + tx * BOARD_RX_PER_ROW);
    tx = 0;
#endif
    connect_tx(tx);
    connect_rx(rx);
    return rx;
}
