/* Counter 0 of the watchdog: resets the processor unless watchdog_feed() is called in time. */
#ifndef PSOC4_WATCHDOG_H
#define PSOC4_WATCHDOG_H

/* The time limit is 1.1 to 4.4 s, because the 32 kHz oscillator runs at 15 to 60 kHz (confirm). Every operation of
 * the images is shorter. */
void watchdog_start(void);
void watchdog_feed(void);

#endif
