/* Fault record: the last fault of the application since power-on, in RAM that keeps its content over a reset. */
#ifndef PSOC4_FAULT_H
#define PSOC4_FAULT_H

#include <stdint.h>

/* The record: TAXEL_FAULT_RECORD_SIZE bytes, laid out as in the register of a board (image.ld.in). */
extern const uint8_t fault_record[];

/* Check the record after a reset, and empty it after a power-on. */
void fault_init(void);

/* Store the fault that the board does not scan (TAXEL_FAULT_CODE_NOT_SCANNING). */
void fault_store_not_scanning(void);

#endif
