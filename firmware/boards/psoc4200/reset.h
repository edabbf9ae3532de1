/* Resets: why the last one, a note for the next one, and the processor's own number. */
#ifndef PSOC4200_RESET_H
#define PSOC4200_RESET_H

#include <stdbool.h>
#include <stdint.h>

/* The bootloader, once: read the hardware's cause, clear it, and leave it where any image finds it. */
void reset_take_cause(void);
/* All that the bootloader asks. */
bool reset_was_commanded(void);
/* enum taxel_reset_cause. */
uint8_t reset_cause(void);

/* Whether reset_into_bootloader() made the last reset. Asking clears it. */
bool reset_stay_requested(void);
void reset_into_bootloader(void);
void reset_now(void);

/* Eight bytes: lot, wafer, place on the wafer, test results. */
void reset_unique_id(uint8_t *id);

#endif
