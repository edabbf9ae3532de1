#include "boards/psoc4200/bringup/text.h"

#include "board_pins.h"
#include "part/peri_clk.h"
#include "boards/psoc4/regs/scb.h"

#define OVERSAMPLE 16u
#define DIVIDER 26u       /* 48 MHz / 26 / 16 = 115,385 baud */
#define WAIT_LOOPS 20000u /* some milliseconds: a UART without a clock must not stop the tests */
#define DIGITS 10u

/* Set up serial block 1 as the UART and connect its pins. */
void text_init(void)
{
    const uint32_t ctrl = SCB_CTRL_MODE_UART | SCB_CTRL_OVERSAMPLE(OVERSAMPLE);
    PERI_CLK->divider_b[0] = (DIVIDER - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->select[PERI_CLK_OF_SCB1] = PERI_CLK_SELECT_B(0u);
    SCB1->ctrl = ctrl;
    SCB1->uart_ctrl = 0;
    SCB1->uart_tx_ctrl = SCB_UART_STOP_BITS_1;
    SCB1->uart_rx_ctrl = SCB_UART_STOP_BITS_1;
    SCB1->tx_ctrl = SCB_DATA_WIDTH(8u);
    SCB1->rx_ctrl = SCB_DATA_WIDTH(8u) | SCB_RX_CTRL_MEDIAN;
    SCB1->tx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    SCB1->rx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    SCB1->tx_fifo_ctrl = SCB_FIFO_CTRL_LEVEL(1u);
    SCB1->rx_fifo_ctrl = 0;
    SCB1->ctrl = ctrl | SCB_CTRL_ENABLED;
    pin_connect(BOARD_PIN_UART_RX, PIN_MODE_INPUT, PIN_UART);
    pin_connect(BOARD_PIN_UART_TX, PIN_MODE_STRONG, PIN_UART);
}

/* Send a byte when the transmit FIFO has space; the byte is dropped if there is none after WAIT_LOOPS checks. */
static void put_byte(uint8_t byte)
{
    for (unsigned i = 0; i < WAIT_LOOPS; i++) {
        if ((SCB1->tx_fifo_status & SCB_FIFO_STATUS_USED) < SCB_FIFO_SIZE) {
            SCB1->tx_fifo_wr = byte;
            return;
        }
    }
}

/* Send the characters of a zero-terminated text. */
void text_put(const char *text)
{
    while (*text) {
        put_byte((uint8_t)*text++);
    }
}

/* Send " name=value" with decimal digits. */
void text_number(const char *name, uint32_t value)
{
    char digits[DIGITS + 1u];
    unsigned first = DIGITS;
    digits[DIGITS] = 0;
    do {
        digits[--first] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value);
    text_put(" ");
    text_put(name);
    text_put("=");
    text_put(digits + first);
}

/* Send " name=bytes" with two hexadecimal digits per byte. */
void text_hex(const char *name, const uint8_t *bytes, unsigned count)
{
    static const char digits[] = "0123456789abcdef";
    text_put(" ");
    text_put(name);
    text_put("=");
    for (unsigned i = 0; i < count; i++) {
        put_byte((uint8_t)digits[bytes[i] >> 4]);
        put_byte((uint8_t)digits[bytes[i] & 15u]);
    }
}

void text_end_line(void)
{
    text_put("\r\n");
}

/* Take a received byte. Returns false if there is none. */
bool text_take(uint8_t *byte)
{
    if (!(SCB1->rx_fifo_status & SCB_FIFO_STATUS_USED)) {
        return false;
    }
    *byte = (uint8_t)SCB1->rx_fifo_rd;
    return true;
}
