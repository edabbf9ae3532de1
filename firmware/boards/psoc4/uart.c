#include "boards/psoc4/uart.h"

#include "boards/psoc4/clocks.h"
#include "boards/psoc4/regs/core.h"
#include "boards/psoc4/regs/scb.h"
#include "boards/psoc4/serial_blocks.h"
#include "boards/psoc4/ticks.h"
#include "part/peri_clk.h"
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

#ifdef BOARD_PIN_UART_RTS
_Static_assert(BOARD_PIN_UART_RX >> 4 == BOARD_PIN_UART_RTS >> 4, "RTS is on the port of RX and TX");
#define RTS_MODE MODE(RTS, STRONG)
#define RTS_FUNCTION FUNCTION(RTS, GPIO)
#else
#define RTS_MODE 0u
#define RTS_FUNCTION 0u
#endif
_Static_assert(DIVIDER * OVERSAMPLE * UART_BAUD == CPU_HZ, "the baud rate divides 3 or 2 MHz");

/* Set up the serial block of the UART to the host, 8 data bits and 1 stop bit, with RTS as a manually driven pin. */
void uart_init(void)
{
    peri_clk_start_uart(UART_PERI_CLK, DIVIDER);
    uart_hold(false);
    UART_SCB->ctrl = SCB_CTRL_MODE_UART | SCB_CTRL_OVERSAMPLE(OVERSAMPLE);
    UART_SCB->uart_ctrl = 0; /* standard mode, no loopback */
    UART_SCB->uart_tx_ctrl = SCB_UART_STOP_BITS_1;
    UART_SCB->uart_rx_ctrl = SCB_UART_STOP_BITS_1;
    UART_SCB->tx_ctrl = SCB_DATA_WIDTH(8u);
    UART_SCB->rx_ctrl = SCB_DATA_WIDTH(8u) | SCB_RX_CTRL_MEDIAN;
    UART_SCB->tx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    UART_SCB->rx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    UART_SCB->tx_fifo_ctrl = SCB_FIFO_CTRL_LEVEL(REFILL_BELOW);
    UART_SCB->rx_fifo_ctrl = 0;
    UART_SCB->intr_rx = SCB_INTR_ALL;
    UART_SCB->intr_tx_mask = 0;
    UART_SCB->intr_rx_mask = SCB_INTR_RX_NOT_EMPTY | SCB_INTR_RX_OVERFLOW;
    UART_SCB->ctrl = SCB_CTRL_MODE_UART | SCB_CTRL_OVERSAMPLE(OVERSAMPLE) | SCB_CTRL_ENABLED;
    UART_PORT->mode = MODE(RX, INPUT) | MODE(TX, STRONG) | RTS_MODE;
    HSIOM_PORT_SELECT(BOARD_PIN_UART_RX >> 4) = FUNCTION(RX, UART) | FUNCTION(TX, UART) | RTS_FUNCTION;
    interrupt_enable(UART_IRQ);
}

/* Switch the UART off and disconnect its pins, as after a reset. */
void uart_off(void)
{
    UART_SCB->ctrl = 0;
    UART_PORT->mode = 0;
    HSIOM_PORT_SELECT(BOARD_PIN_UART_RX >> 4) = 0;
}

#if IMAGE_DEVICE == 2 && defined IMAGE_APPLICATION
#define BYTE_US (10u * 1000000u / UART_BAUD + 1u)

/* Wait until the FIFO is empty, and then for the byte that is on the wire. */
void uart_finish(void)
{
    while (UART_SCB->tx_fifo_status & SCB_FIFO_STATUS_USED) {
    }
    ticks_delay_us(BYTE_US);
}
#endif

/* Start transmission: enable the interrupt that fetches bytes from the program with uart_pull(). */
void uart_kick(void)
{
    UART_SCB->intr_tx_mask = SCB_INTR_TX_TRIGGER; /* the FIFO has space: the interrupt follows at once */
}

/* Set the RTS output, if the board has one: `hold` requests that the host pauses. A single store, because both the main
 * loop and the interrupt call this function. */
void uart_hold(bool hold)
{
#ifdef BOARD_PIN_UART_RTS
    UART_PORT->data = (uint32_t)hold << NUMBER(RTS);
#else
    (void)hold;
#endif
}

/* Pass all bytes of the RX FIFO to uart_on_byte(). An overflow of the FIFO is reported first, with
 * uart_on_lost_byte(). */
static void receive_bytes(void)
{
    if (UART_SCB->intr_rx & SCB_INTR_RX_OVERFLOW) {
        UART_SCB->intr_rx = SCB_INTR_RX_OVERFLOW;
        uart_on_lost_byte();
    }
    while (UART_SCB->rx_fifo_status & SCB_FIFO_STATUS_USED) {
        uart_on_byte((uint8_t)UART_SCB->rx_fifo_rd);
    }
    UART_SCB->intr_rx = SCB_INTR_RX_NOT_EMPTY;
}

/* Fill the free space of the TX FIFO with bytes that uart_pull() takes from the program. If the program has fewer bytes
 * than fit, disable the interrupt of the TX FIFO: uart_kick() enables it again. */
static void refill_fifo(void)
{
    uint8_t bytes[SCB_FIFO_SIZE];
    const size_t space = SCB_FIFO_SIZE - (UART_SCB->tx_fifo_status & SCB_FIFO_STATUS_USED);
    const size_t count = uart_pull(bytes, space);
    for (size_t i = 0; i < count; i++) {
        UART_SCB->tx_fifo_wr = bytes[i];
    }
    if (count < space) {
        UART_SCB->intr_tx_mask = 0;
    }
    UART_SCB->intr_tx = SCB_INTR_TX_TRIGGER;
}

void uart_handler(void);
/* Handle the interrupt of the UART: received bytes, and space in the TX FIFO. */
void uart_handler(void)
{
    if (UART_SCB->intr_rx_masked) {
        receive_bytes();
    }
    if (UART_SCB->intr_tx_masked) {
        refill_fifo();
    }
}
