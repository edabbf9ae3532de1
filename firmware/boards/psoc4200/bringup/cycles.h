/* Times by polling the timer SysTick, which counts 24 bits of the processor clock, without its interrupt. */
#ifndef PSOC4200_BRINGUP_CYCLES_H
#define PSOC4200_BRINGUP_CYCLES_H

#include <stdint.h>

#include "boards/psoc4/regs/core.h"

#define CYCLES_MASK 0xFFFFFFu
#define CYCLES_PER_MS 48000u

/* Start the timer with the processor clock, without its interrupt. */
static inline void cycles_init(void)
{
    SYSTICK->reload = CYCLES_MASK;
    SYSTICK->value = 0;
    SYSTICK->control = SYSTICK_CONTROL_ENABLE | SYSTICK_CONTROL_PROCESSOR_CLOCK;
}

/* Return the number of processor cycles since cycles_init(), modulo 2^24. */
static inline uint32_t cycles_now(void)
{
    return CYCLES_MASK - SYSTICK->value;
}

/* Return the number of cycles since `begin`, a value of cycles_now() within the last 349 ms. */
static inline uint32_t cycles_since(uint32_t begin)
{
    return (cycles_now() - begin) & CYCLES_MASK;
}

#endif
