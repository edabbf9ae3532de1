/* SysTick, the 24-bit timer. Its value is computed when it is accessed: the counter decrements, sets the exception
 * pending when it reaches 0, and reloads at the following tick (ARM DDI 0419, B3.3). */
#include "emulator/cortex_m0/internal.h"

#define MASK 0xFFFFFFu
#define ENABLE 1u
#define TICKINT 2u
#define CLKSOURCE 4u
#define COUNTFLAG 0x10000u

/* Return the number of processor cycles per count of the timer SysTick: 1, or the period of the external reference
 * clock. */
static uint64_t cycles_per_tick(const struct cortex_m0 *cpu)
{
    return cpu->systick.processor_clock ? 1u : cpu->config.systick_reference;
}

/* Return the ticks from the cycle `origin` until the counter reaches 0; 0 if the counter is stopped at 0. */
static uint64_t ticks_to_zero(const struct cortex_m0_systick *timer)
{
    if (timer->value) {
        return timer->value;
    }
    return timer->reload ? timer->reload + UINT64_C(1) : 0;
}

/* Advance SysTick to `cycle`: compute the counter value, set COUNTFLAG if it has passed 0, and make the exception
 * pending as of the cycle in which it first did. Called at accesses and between runs of instructions, not once per
 * tick. */
void cortex_m0_systick_settle(struct cortex_m0 *cpu, uint64_t cycle)
{
    struct cortex_m0_systick *timer = &cpu->systick;
    if (!timer->enabled) {
        timer->origin = cycle;
        return;
    }
    if (cycle <= timer->origin) {
        return;
    }
    const uint64_t ticks = (cycle - timer->origin) / cycles_per_tick(cpu), first_zero = ticks_to_zero(timer);
    const uint64_t begin_cycle = timer->origin;
    timer->origin += ticks * cycles_per_tick(cpu);
    if (!first_zero || !ticks) {
        return;
    }
    if (ticks < first_zero) {
        timer->value = (uint32_t)(first_zero - ticks);
        return;
    }
    const uint64_t ticks_since_reload = timer->reload ? (ticks - first_zero) % (timer->reload + UINT64_C(1)) : 0;
    timer->value = ticks_since_reload ? (uint32_t)(timer->reload + 1u - ticks_since_reload) : 0;
    timer->count_flag = true;
    if (timer->interrupt_enabled) {
        cortex_m0_set_pending(cpu, CORTEX_M0_SYSTICK, begin_cycle + first_zero * cycles_per_tick(cpu));
    }
}

/* Return the cycle in which the SysTick exception becomes pending next; UINT64_MAX if the counter is stopped or its
 * interrupt is disabled. */
uint64_t cortex_m0_systick_due(const struct cortex_m0 *cpu)
{
    const struct cortex_m0_systick *timer = &cpu->systick;
    const uint64_t ticks = ticks_to_zero(timer);
    return timer->enabled && timer->interrupt_enabled && ticks ? timer->origin + ticks * cycles_per_tick(cpu)
                                                               : UINT64_MAX;
}

/* Return the value of the timer's control register SYST_CSR. */
uint32_t cortex_m0_systick_control(const struct cortex_m0 *cpu)
{
    const struct cortex_m0_systick *timer = &cpu->systick;
    return (timer->enabled ? ENABLE : 0) | (timer->interrupt_enabled ? TICKINT : 0) |
           (timer->processor_clock ? CLKSOURCE : 0) | (timer->count_flag ? COUNTFLAG : 0);
}

/* Write SYST_CSR: enable, interrupt enable and clock source. Without a reference clock the counter always uses the
 * processor clock. */
void cortex_m0_systick_set_control(struct cortex_m0 *cpu, uint32_t value)
{
    struct cortex_m0_systick *timer = &cpu->systick;
    timer->enabled = value & ENABLE;
    timer->interrupt_enabled = value & TICKINT;
    timer->processor_clock = value & CLKSOURCE || !cpu->config.systick_reference;
    cpu->attention = true;
}

/* Stop the clock of SysTick for `cycles`, as in deep sleep. */
void cortex_m0_systick_pause(struct cortex_m0 *cpu, uint64_t cycles)
{
    cpu->systick.origin += cycles;
}
