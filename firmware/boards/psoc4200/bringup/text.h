/* Lines of text to the UART, and bytes from it, by polling, because the numbers of the interrupts may be wrong. */
#ifndef PSOC4200_BRINGUP_TEXT_H
#define PSOC4200_BRINGUP_TEXT_H

#include <stdbool.h>
#include <stdint.h>

/* Set up the UART: 115,200 baud (0.2 % more), 8 data bits, 1 stop bit. */
void text_init(void);
void text_put(const char *text);
/* Send " name=value" with decimal digits, or " name=bytes" with hexadecimal digits. */
void text_number(const char *name, uint32_t value);
void text_hex(const char *name, const uint8_t *bytes, unsigned count);
void text_end_line(void);
/* Take a received byte. Returns false if there is none. */
bool text_take(uint8_t *byte);

#endif
