#include "boards/psoc4200/uart.h"

#include "boards/psoc4200/clocks.h"
#include "boards/psoc4200/regs/core.h"
#include "boards/psoc4200/regs/peri_clk.h"
#include "boards/psoc4200/regs/scb.h"
#include "board_pins.h"

#ifndef UART_BAUD
#define UART_BAUD 1000000u
#endif

#define OVERSAMPLE (CPU_HZ / 24000000u * 4u + 8u) /* clocks per bit, 8 to 16: 16 at 48 MHz, 12 at 24 MHz */
#define DIVIDER (CPU_HZ / (OVERSAMPLE * UART_BAUD))
#define REFILL_BELOW 4u /* bytes: half of the FIFO, 40 us at 1 Mbaud */

#define NUMBER(name) (BOARD_PIN_UART_##name & 7u)
#define MODE(name, mode) ((uint32_t)PIN_MODE_##mode << (3u * NUMBER(name)))
#define FUNCTION(name, function) ((uint32_t)PIN_##function << (4u * NUMBER(name)))
#define UART_PORT (&PORTS[BOARD_PIN_UART_RX >> 4]) /* the port has no other pins in use: whole registers are written */

_Static_assert(BOARD_PIN_UART_RX >> 4 == BOARD_PIN_UART_RTS >> 4, "RTS is on the port of RX and TX");
_Static_assert(DIVIDER * OVERSAMPLE * UART_BAUD == CPU_HZ, "the baud rate divides 3 or 2 MHz");

/* Set up serial block SCB1 as the UART to the host, 8 data bits and 1 stop bit, with RTS as a manually driven pin. */
void uart_init(void)
{
    PERI_CLK->divider_b[0] = (DIVIDER - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->select[PERI_CLK_OF_SCB1] = PERI_CLK_SELECT_B(0u);
    uart_hold(false);
    SCB1->ctrl = SCB_CTRL_MODE_UART | SCB_CTRL_OVERSAMPLE(OVERSAMPLE);
    SCB1->uart_ctrl = 0; /* standard mode, no loopback */
    SCB1->uart_tx_ctrl = SCB_UART_STOP_BITS_1;
    SCB1->uart_rx_ctrl = SCB_UART_STOP_BITS_1;
    SCB1->tx_ctrl = SCB_DATA_WIDTH(8u);
    SCB1->rx_ctrl = SCB_DATA_WIDTH(8u) | SCB_RX_CTRL_MEDIAN;
    SCB1->tx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    SCB1->rx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    SCB1->tx_fifo_ctrl = SCB_FIFO_CTRL_LEVEL(REFILL_BELOW);
    SCB1->rx_fifo_ctrl = 0;
    SCB1->intr_rx = SCB_INTR_ALL;
    SCB1->intr_tx_mask = 0;
    SCB1->intr_rx_mask = SCB_INTR_RX_NOT_EMPTY | SCB_INTR_RX_OVERFLOW;
    SCB1->ctrl = SCB_CTRL_MODE_UART | SCB_CTRL_OVERSAMPLE(OVERSAMPLE) | SCB_CTRL_ENABLED;
    UART_PORT->mode = MODE(RX, INPUT) | MODE(TX, STRONG) | MODE(RTS, STRONG);
    HSIOM_PORT_SELECT[BOARD_PIN_UART_RX >> 4] = FUNCTION(RX, UART) | FUNCTION(TX, UART) | FUNCTION(RTS, GPIO);
    interrupt_enable(IRQ_SCB1);
}

/* Switch the UART off and disconnect its pins, as after a reset. */
void uart_off(void)
{
    SCB1->ctrl = 0;
    UART_PORT->mode = 0;
    HSIOM_PORT_SELECT[BOARD_PIN_UART_RX >> 4] = 0;
}

/* Starts transmission: enables the interrupt that fetches bytes from the program with uart_pull(). */
void uart_kick(void)
{
    SCB1->intr_tx_mask = SCB_INTR_TX_TRIGGER; /* the FIFO has space: the interrupt follows at once */
}

/* Sets the RTS output: `hold` requests that the host pauses. A single store, because both the main loop and the
 * interrupt call this function. */
void uart_hold(bool hold)
{
    UART_PORT->data = (uint32_t)hold << NUMBER(RTS);
}

/* Pass all bytes of the RX FIFO to uart_on_byte(). An overflow of the FIFO is reported first. */
static void receive_bytes(void)
{
    if (SCB1->intr_rx & SCB_INTR_RX_OVERFLOW) {
        SCB1->intr_rx = SCB_INTR_RX_OVERFLOW;
        uart_on_lost_byte();
    }
    while (SCB1->rx_fifo_status & SCB_FIFO_STATUS_USED) {
        uart_on_byte((uint8_t)SCB1->rx_fifo_rd);
    }
    SCB1->intr_rx = SCB_INTR_RX_NOT_EMPTY;
}

/* Fill the TX FIFO with queued bytes, and disable its interrupt when none are left. */
static void refill_fifo(void)
{
    uint8_t bytes[SCB_FIFO_SIZE];
    const size_t space = SCB_FIFO_SIZE - (SCB1->tx_fifo_status & SCB_FIFO_STATUS_USED);
    const size_t count = uart_pull(bytes, space);
    for (size_t i = 0; i < count; i++) {
        SCB1->tx_fifo_wr = bytes[i];
    }
    if (count < space) {
        SCB1->intr_tx_mask = 0;
    }
    SCB1->intr_tx = SCB_INTR_TX_TRIGGER;
}

void scb1_handler(void);
/* Interrupt of the UART: received bytes, and space in the TX FIFO. */
void scb1_handler(void)
{
    if (SCB1->intr_rx_masked) {
        receive_bytes();
    }
    if (SCB1->intr_tx_masked) {
        refill_fifo();
    }
}
