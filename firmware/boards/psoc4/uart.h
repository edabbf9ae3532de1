/* Serial block of the UART: 8 data bits, no parity, 1 stop bit. RTS is a software-controlled output: this SCB has no
 * flow control. */
#ifndef PSOC4_UART_H
#define PSOC4_UART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

void uart_init(void);
/* Return block and pins to their state after a reset. */
void uart_off(void);

/* Wait until the last byte of the TX FIFO has been sent, at most 9 byte times. */
void uart_finish(void);

/* Start to transmit: the interrupt calls uart_pull() until it returns no bytes. */
void uart_kick(void);
/* Set RTS: high (`hold`) stops the host's adapter. */
void uart_hold(bool hold);

/* Defined by the image, and called from the interrupt: a byte was received; a byte was lost because the FIFO was full;
 * copy up to `size` bytes to send to `bytes` and return their number. */
void uart_on_byte(uint8_t byte);
void uart_on_lost_byte(void);
size_t uart_pull(uint8_t *bytes, size_t size);

#endif
