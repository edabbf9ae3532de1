/* Flash rows, written by the supervisory ROM. */
#ifndef PSOC4_FLASH_ROWS_H
#define PSOC4_FLASH_ROWS_H

#include <stdint.h>

/* Erase and write 128 bytes, which takes up to 20 ms. The caller must disable interrupts, switch off every
 * peripheral that cannot wait for 20 ms, and read the row back, because no status is returned. */
void flash_rows_write(uint16_t row, const uint8_t *bytes);

#endif
