/* HFCLK and SYSCLK come from the main oscillator: 24 MHz in the bootloader, 48 MHz in applications. */
#ifndef PSOC4_CLOCKS_H
#define PSOC4_CLOCKS_H

#include "part/numbers.h"

#ifdef IMAGE_APPLICATION
#define CPU_HZ 48000000u
#else
#define CPU_HZ 24000000u
#endif

#ifdef PART_STARTS_SLOWLY
/* Bootloader: change the clock after a reset to 24 MHz. */
void clocks_start(void);
#else
static inline void clocks_start(void)
{
    /* 24 MHz is the clock after a reset */
}
#endif

/* Change the clock of an application from 24 to 48 MHz. */
void clocks_init(void);

#endif
