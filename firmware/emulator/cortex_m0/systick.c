/* The 24-bit timer, computed when somebody looks: it counts down, becomes pending when it reaches 0, and reloads with the tick
 * after that (ARM DDI 0419, B3.3). */
#include "emulator/cortex_m0/parts.h"

#define MASK 0xFFFFFFu
#define ENABLE 1u
#define TICKINT 2u
#define CLKSOURCE 4u
#define COUNTFLAG 0x10000u

/* Cycles a tick. */
static uint64_t tick(const struct cortex_m0 *cpu)
{
    return cpu->systick.processor_clock ? 1u : cpu->config.systick_reference;
}

/* Ticks from the origin to the counter's next 0; 0: it stays there. */
static uint64_t ticks_to_zero(const struct cortex_m0_systick *timer)
{
    if (timer->value) {
        return timer->value;
    }
    return timer->reload ? timer->reload + UINT64_C(1) : 0;
}

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
    const uint64_t ticks = (cycle - timer->origin) / tick(cpu), first = ticks_to_zero(timer);
    const uint64_t begin = timer->origin;
    timer->origin += ticks * tick(cpu);
    if (!first || !ticks) {
        return;
    }
    if (ticks < first) {
        timer->value = (uint32_t)(first - ticks);
        return;
    }
    const uint64_t since = timer->reload ? (ticks - first) % (timer->reload + UINT64_C(1)) : 0;
    timer->value = since ? (uint32_t)(timer->reload + 1u - since) : 0;
    timer->counted = true;
    if (timer->interrupts) {
        cortex_m0_pend(cpu, CORTEX_M0_SYSTICK, begin + first * tick(cpu));
    }
}

uint64_t cortex_m0_systick_due(const struct cortex_m0 *cpu)
{
    const struct cortex_m0_systick *timer = &cpu->systick;
    const uint64_t ticks = ticks_to_zero(timer);
    return timer->enabled && timer->interrupts && ticks ? timer->origin + ticks * tick(cpu) : UINT64_MAX;
}

uint32_t cortex_m0_systick_control(const struct cortex_m0 *cpu)
{
    const struct cortex_m0_systick *timer = &cpu->systick;
    return (timer->enabled ? ENABLE : 0) | (timer->interrupts ? TICKINT : 0) | (timer->processor_clock ? CLKSOURCE : 0) |
           (timer->counted ? COUNTFLAG : 0);
}

void cortex_m0_systick_set_control(struct cortex_m0 *cpu, uint32_t value)
{
    struct cortex_m0_systick *timer = &cpu->systick;
    timer->enabled = value & ENABLE;
    timer->interrupts = value & TICKINT;
    timer->processor_clock = value & CLKSOURCE || !cpu->config.systick_reference;
    cpu->attention = true;
}

void cortex_m0_systick_pause(struct cortex_m0 *cpu, uint64_t cycles)
{
    cpu->systick.origin += cycles;
}
