/* NVIC: pending, enabled and active exceptions as bit masks over exception numbers, with four priority levels. */
#include "emulator/cortex_m0/internal.h"

#define ALWAYS_ENABLED \
    (CORTEX_M0_BIT(CORTEX_M0_NMI) | CORTEX_M0_BIT(CORTEX_M0_HARD_FAULT) | CORTEX_M0_BIT(CORTEX_M0_SVCALL) | \
     CORTEX_M0_BIT(CORTEX_M0_PENDSV) | CORTEX_M0_BIT(CORTEX_M0_SYSTICK))

/* Reset the exception state: every interrupt disabled and at priority 0; an interrupt whose input is high is pending.
 */
void cortex_m0_reset_nvic(struct cortex_m0 *cpu)
{
    cpu->active = 0;
    cpu->enabled = ALWAYS_ENABLED;
    cpu->pending = (uint64_t)cpu->lines << CORTEX_M0_IRQ0;
    cpu->level[0] = ~UINT64_C(0); /* level[p]: bit mask of the exceptions with priority p */
    cpu->level[1] = cpu->level[2] = cpu->level[3] = 0;
    cortex_m0_update_priority(cpu);
}

/* Make exception `number` pending, and store the cycle for the latency. With SEVONPEND a newly pending interrupt also
 * sets the event register, which ends WFE. */
void cortex_m0_set_pending(struct cortex_m0 *cpu, unsigned number, uint64_t cycle)
{
    if (cpu->pending & CORTEX_M0_BIT(number)) {
        return;
    }
    cpu->pending |= CORTEX_M0_BIT(number);
    cpu->pended_at[number] = cycle;
    cpu->attention = true;
    if (cpu->event_on_pending && number >= CORTEX_M0_IRQ0) {
        cpu->event = true;
    }
}

/* Return the number of the enabled pending exception that preempts execution at `priority` (a lower number is a higher
 * priority), or 0 if there is none. NMI and HardFault have the fixed priorities -2 and -1. */
unsigned cortex_m0_next_exception(const struct cortex_m0 *cpu, int priority)
{
    const uint64_t ready = cpu->pending & cpu->enabled;
    if (!ready) {
        return 0;
    }
    if (ready & CORTEX_M0_BIT(CORTEX_M0_NMI) && priority > CORTEX_M0_PRIORITY_NMI) {
        return CORTEX_M0_NMI;
    }
    if (ready & CORTEX_M0_BIT(CORTEX_M0_HARD_FAULT) && priority > CORTEX_M0_PRIORITY_HARD_FAULT) {
        return CORTEX_M0_HARD_FAULT;
    }
    for (int level = 0; level < priority && level < CORTEX_M0_PRIORITY_THREAD; level++) {
        const uint64_t ready_at_level = ready & cpu->level[level];
        if (ready_at_level) {
            return (unsigned)__builtin_ctzll(ready_at_level); /* equal priority: the lowest number is taken first */
        }
    }
    return 0;
}

/* Return the configured priority of an exception, 0 (highest) to 3. */
unsigned cortex_m0_level_of(const struct cortex_m0 *cpu, unsigned number)
{
    unsigned level = 0;
    while (level < 3 && !(cpu->level[level] & CORTEX_M0_BIT(number))) {
        level++;
    }
    return level;
}

/* Set the configured priority, 0 (highest) to 3, of an exception. */
void cortex_m0_set_level(struct cortex_m0 *cpu, unsigned number, unsigned level)
{
    for (unsigned i = 0; i < 4; i++) {
        cpu->level[i] &= ~CORTEX_M0_BIT(number);
    }
    cpu->level[level] |= CORTEX_M0_BIT(number);
}

/* Return the priority of an exception: fixed for NMI (-2) and HardFault (-1), otherwise the configured level 0 to 3. */
int cortex_m0_priority_of(const struct cortex_m0 *cpu, unsigned number)
{
    switch (number) {
    case CORTEX_M0_NMI:
        return CORTEX_M0_PRIORITY_NMI;
    case CORTEX_M0_HARD_FAULT:
        return CORTEX_M0_PRIORITY_HARD_FAULT;
    default:
        return (int)cortex_m0_level_of(cpu, number);
    }
}

/* Return the execution priority without the effect of PRIMASK: the highest priority (lowest number) of all active
 * exceptions; 4 in thread mode. */
int cortex_m0_priority_unmasked(const struct cortex_m0 *cpu)
{
    int priority = CORTEX_M0_PRIORITY_THREAD;
    for (uint64_t remaining = cpu->active; remaining; remaining &= remaining - 1u) {
        const int candidate = cortex_m0_priority_of(cpu, (unsigned)__builtin_ctzll(remaining));
        priority = candidate < priority ? candidate : priority;
    }
    return priority;
}

/* Recompute the execution priority after a change of the active exceptions, a priority or PRIMASK; PRIMASK raises it to
 * 0. */
void cortex_m0_update_priority(struct cortex_m0 *cpu)
{
    const int priority = cortex_m0_priority_unmasked(cpu);
    cpu->priority = (int8_t)(cpu->primask && priority > 0 ? 0 : priority);
    cpu->attention = true;
}

/* Set the level of an interrupt input. A rising edge makes the interrupt pending; while the input stays high, the
 * interrupt becomes pending again after its handler. */
void cortex_m0_set_line(struct cortex_m0 *cpu, unsigned irq, bool high)
{
    const uint32_t bit = UINT32_C(1) << irq;
    if (high && !(cpu->lines & bit)) {
        cortex_m0_set_pending(cpu, CORTEX_M0_IRQ0 + irq, cpu->cycle);
    }
    cpu->lines = high ? cpu->lines | bit : cpu->lines & ~bit;
}

/* Make interrupt number `irq` pending once, as a short pulse on its line does. */
void cortex_m0_pulse(struct cortex_m0 *cpu, unsigned irq)
{
    cortex_m0_set_pending(cpu, CORTEX_M0_IRQ0 + irq, cpu->cycle);
}

/* Make the non-maskable interrupt pending once. */
void cortex_m0_pulse_nmi(struct cortex_m0 *cpu)
{
    cortex_m0_set_pending(cpu, CORTEX_M0_NMI, cpu->cycle);
}

/* Set the event flag of the processor, which ends a sleep by the instruction WFE. */
void cortex_m0_send_event(struct cortex_m0 *cpu)
{
    cpu->event = true;
    cpu->attention = true;
}
