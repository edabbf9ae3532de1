/* Times by polling the timer SysTick, which counts 24 bits of the processor clock, without its interrupt. */
#ifndef PSOC4200_BRINGUP_CYCLES_H
#define PSOC4200_BRINGUP_CYCLES_H

#include <stdint.h>

#include "boards/psoc4200/regs/core.h"

#define CYCLES_MASK 0xFFFFFFu
#define CYCLES_PER_MS 48000u

static inline void cycles_init(void)
{
    SYSTICK->reload = CYCLES_MASK;
    SYSTICK->value = 0;
    SYSTICK->control = SYSTICK_CONTROL_ENABLE | SYSTICK_CONTROL_PROCESSOR_CLOCK;
}

static inline uint32_t cycles_now(void)
{
    return CYCLES_MASK - SYSTICK->value;
}

/* Cycles since a time within the last 349 ms. */
static inline uint32_t cycles_since(uint32_t begin)
{
    return (cycles_now() - begin) & CYCLES_MASK;
}

#endif
