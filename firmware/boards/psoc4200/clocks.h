/* HFCLK and SYSCLK come from the main oscillator: 24 MHz after a reset, where the bootloader stays, 48 MHz in
 * applications. */
#ifndef PSOC4200_CLOCKS_H
#define PSOC4200_CLOCKS_H

#ifdef IMAGE_APPLICATION
#define CPU_HZ 48000000u
#else
#define CPU_HZ 24000000u
#endif

/* Change the clock of an application from 24 to 48 MHz. */
void clocks_init(void);

#endif
