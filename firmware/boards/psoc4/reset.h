/* Resets: cause of the last one, request for the next one, and the processor's unique id. */
#ifndef PSOC4_RESET_H
#define PSOC4_RESET_H

#include <stdbool.h>
#include <stdint.h>

/* Called once by the bootloader: read the hardware's cause, clear it, and store it for the images. */
void reset_take_cause(void);
/* Return whether software requested the last reset. */
bool reset_was_commanded(void);
/* Return the cause of the last reset (enum taxel_reset_cause). */
uint8_t reset_cause(void);

/* Return whether reset_into_bootloader() caused the last reset. The call clears the request. */
bool reset_stay_requested(void);
void reset_into_bootloader(void);
void reset_now(void);

/* Copy the unique id, eight bytes: lot, wafer, position on the wafer, test results. */
void reset_unique_id(uint8_t *id);

#endif
