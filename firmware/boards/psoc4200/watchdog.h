/* Counter 0 of the watchdog: resets the processor when nobody feeds it. */
#ifndef PSOC4200_WATCHDOG_H
#define PSOC4200_WATCHDOG_H

/* Runs from the 32 kHz oscillator, which is between 15 and 60 kHz (confirm): 1.1 to 4.4 s. Longer than anything here
 * takes. */
void watchdog_start(void);
void watchdog_feed(void);

#endif
