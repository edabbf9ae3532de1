/* Microseconds since ticks_init(), from SysTick. In the bootloader the resolution is 1024 us, because all of its
 * times are 50 ms or longer. */
#ifndef PSOC4_TICKS_H
#define PSOC4_TICKS_H

#include <stdbool.h>
#include <stdint.h>

void ticks_init(void);
uint32_t ticks_us_32(void);

/* Return the microseconds since ticks_init(); applications only. */
uint64_t ticks_us(void);
/* Return the number of SysTick periods (4.1 ms) since ticks_init(), which is cheaper than a time. */
uint32_t ticks_periods(void);
/* Return whether SysTick interrupts before the time `us` (microseconds since ticks_init()). */
bool ticks_interrupts_before(uint64_t us);
void ticks_delay_us(uint32_t microseconds);
/* Between these two calls, with interrupts off, no time is lost for up to 340 ms, and the time must not be read. */
uint32_t ticks_stretch(void);
void ticks_shrink(uint32_t begin); /* the value returned by ticks_stretch() */

#endif
