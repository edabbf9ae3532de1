/* SCB1 as a UART, 8N1. RTS is an output of our own: this SCB has no flow control. */
#ifndef PSOC4200_UART_H
#define PSOC4200_UART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

void uart_init(void);
/* Block and pins as after a reset. */
void uart_off(void);

/* Bytes wait: uart_pull() is called from the interrupt until it has none. */
void uart_kick(void);
/* RTS: high asks the host's adapter to send no more. */
void uart_hold(bool hold);

/* The image has these, and they are called from the interrupt. */
void uart_on_byte(uint8_t byte);
void uart_on_lost_byte(void);
size_t uart_pull(uint8_t *bytes, size_t size);

#endif
