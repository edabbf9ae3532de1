/* Flash rows, written by the supervisory ROM. */
#ifndef PSOC4200_FLASH_ROWS_H
#define PSOC4200_FLASH_ROWS_H

#include <stdint.h>

/* Erase and write 128 bytes: up to 20 ms. The caller has interrupts off, has switched off what must not wait for so
 * long, and reads the row back: there is no other answer. */
void flash_rows_write(uint16_t row, const uint8_t *bytes);

#endif
