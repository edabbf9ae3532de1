/* Public interface of the processor: initialisation, reset and run loop. */
#include "emulator/cortex_m0/cortex_m0.h"

#include <stdlib.h>

#include "emulator/cortex_m0/internal.h"

#define LR_AFTER_RESET 0xFFFFFFFFu
#define PSR_THUMB (1u << 24)
#define LONGEST_RUN (UINT64_C(1) << 62) /* the budget until the deadline is a signed 64-bit number */

/* Return the instruction, exception and flash timing (cycles) of a PSoC 4200 at 48 MHz. cortex_m0.h states the sources
 * of the figures. */
struct cortex_m0_timing cortex_m0_psoc4200(void)
{
    return (struct cortex_m0_timing){
        .taken_branch = 3,
        .special = 4,
        .multiply = 1,
        .flash_wait = 1,
        .exception_entry = 16,
        .exception_return = 12,
        .tail_chain = 6,
        .late_arrival = 12,
    };
}

/* Return the timing of a PSoC 4100S at 48 MHz: that of a Cortex-M0+, with the flash wait states of this part. */
struct cortex_m0_timing cortex_m0_psoc4100s(void)
{
    return (struct cortex_m0_timing){
        .taken_branch = 2,
        .special = 3,
        .multiply = 1,
        .flash_wait = 2,
        .exception_entry = 15,
        .exception_return = 11,
        .tail_chain = 6,
        .late_arrival = 11,
    };
}

/* Initialise a processor and allocate the decoded instructions of flash and RAM. Returns 0, or -1 if out of memory or
 * if the configuration is invalid; call cortex_m0_reset() before the first run. */
int cortex_m0_init(struct cortex_m0 *cpu, const struct cortex_m0_config *config)
{
    *cpu = (struct cortex_m0){.config = *config};
    if (cortex_m0_code_open(&cpu->flash_code, config->flash, config->flash_base, config->flash_size) ||
        cortex_m0_code_open(&cpu->ram_code, config->ram, config->ram_base, config->ram_size) ||
        config->timing.late_arrival > config->timing.exception_entry || !config->timing.multiply ||
        !config->timing.taken_branch || !config->timing.special) {
        cortex_m0_free(cpu);
        return -1;
    }
    cortex_m0_set_flash_wait(cpu, config->timing.flash_wait);
    return 0;
}

/* Free the decoded code of the processor. The caller owns the struct itself. */
void cortex_m0_free(struct cortex_m0 *cpu)
{
    free(cpu->flash_code.operations);
    free(cpu->ram_code.operations);
    cpu->flash_code.operations = cpu->ram_code.operations = NULL;
}

/* Set the number of additional cycles of each non-sequential access to flash (wait states). */
void cortex_m0_set_flash_wait(struct cortex_m0 *cpu, uint8_t wait)
{
    cpu->config.timing.flash_wait = wait;
    cpu->flash_code.refill = wait;
    cpu->attention = true; /* makes the fast path reload its local copy */
}

/* Set the address of the table of exception vectors. */
void cortex_m0_set_vectors(struct cortex_m0 *cpu, uint32_t vectors)
{
    cpu->vector_base = vectors;
}

/* Set the state that a reset clears. The cycle counter, the interrupt inputs and the configuration are kept. */
static void clear_state(struct cortex_m0 *cpu)
{
    memset(cpu->r, 0, sizeof cpu->r);
    cpu->r[CORTEX_M0_LR] = LR_AFTER_RESET;
    cpu->progress = 0;
    cpu->primask = cpu->process_stack = false;
    cpu->asleep = cpu->wakes_on_event = cpu->event = cpu->entering = false;
    cpu->locked_up = cpu->lockup_reported = false;
    cpu->stop_requested = cpu->reset_requested = cpu->fault_pending = false;
    cpu->sleep_on_exit = cpu->deep_sleep = cpu->event_on_pending = false;
    cpu->ipsr = 0;
    cpu->systick = (struct cortex_m0_systick){.origin = cpu->cycle, .processor_clock = !cpu->config.systick_reference};
    cpu->fault = (struct cortex_m0_fault){0};
    cpu->other_sp = 0;
    if (cpu->account) {
        cpu->account->depth = 0;
    }
}

/* Reset the processor and load the stack pointer and the start address from the vector table at `vectors`. A vector
 * table that cannot be read locks the processor up. */
void cortex_m0_reset(struct cortex_m0 *cpu, uint32_t vectors)
{
    uint32_t sp, entry_address;
    clear_state(cpu);
    cortex_m0_reset_nvic(cpu);
    cortex_m0_set_xpsr(cpu, PSR_THUMB);
    cpu->vector_base = vectors;
    const uint64_t cycle = cpu->cycle; /* the reads of the vectors take no time */
    const bool fails =
        cortex_m0_read(cpu, vectors, 4, false, &sp) || cortex_m0_read(cpu, vectors + 4u, 4, false, &entry_address);
    cpu->cycle = cycle;
    if (fails) {
        cpu->fault.kind = CORTEX_M0_FAULT_VECTOR;
        cortex_m0_lock_up(cpu);
        return;
    }
    cpu->r[CORTEX_M0_SP] = sp & ~UINT32_C(3);
    cpu->r[CORTEX_M0_PC] = entry_address & ~UINT32_C(1);
    cpu->thumb = entry_address & 1u;
    cortex_m0_reset_stack_marks(cpu);
}

/* Put the processor to sleep after WFI or WFE (wakes_on_event). */
void cortex_m0_sleep(struct cortex_m0 *cpu, bool wakes_on_event)
{
    cpu->asleep = true;
    cpu->wakes_on_event = wakes_on_event;
    cpu->asleep_since = cpu->cycle;
    cpu->attention = true;
}

/* Advance the cycle counter to `until` without executing instructions. In deep sleep the clock of SysTick is stopped.
 */
static void advance_idle(struct cortex_m0 *cpu, uint64_t until)
{
    if (cpu->deep_sleep && cpu->asleep) {
        cortex_m0_systick_pause(cpu, until - cpu->cycle);
    }
    cpu->cycle = until;
}

/* End the sleep of WFI or WFE if an exception or, for WFE, an event is due; returns whether the processor is awake. A
 * pending exception that PRIMASK masks ends WFI and stays pending (ARM DDI 0419, B1.5.19). */
static bool try_to_wake(struct cortex_m0 *cpu)
{
    const bool by_event = cpu->wakes_on_event && cpu->event;
    const int priority = cpu->wakes_on_event ? cpu->priority : cortex_m0_priority_unmasked(cpu);
    if (!by_event && !cortex_m0_next_exception(cpu, priority)) {
        return false;
    }
    if (by_event) {
        cpu->event = false;
    }
    cpu->asleep = false;
    cpu->sleep_cycles += cpu->cycle - cpu->asleep_since;
    return true;
}

/* Return the cycle in which SysTick wakes the sleeping processor; UINT64_MAX if it never does, or if the processor is
 * awake. */
uint64_t cortex_m0_wake_cycle(const struct cortex_m0 *cpu)
{
    return cpu->asleep && !cpu->deep_sleep ? cortex_m0_systick_due(cpu) : UINT64_MAX;
}

/* Execute an SVC instruction: SVCall becomes pending. At a priority that does not let SVCall preempt, SVC is a
 * HardFault (ARM DDI 0419, B1.5). */
static void call_supervisor(struct cortex_m0 *cpu)
{
    if (cortex_m0_priority_of(cpu, CORTEX_M0_SVCALL) >= cpu->priority) {
        cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_SVC, cpu->r[CORTEX_M0_PC]);
        cpu->fault_pending = true;
        return;
    }
    cpu->r[CORTEX_M0_PC] += 2u;
    cpu->cycle++;
    cortex_m0_set_pending(cpu, CORTEX_M0_SVCALL, cpu->cycle);
}

/* Execute instructions until the cycle `until` or until SysTick is due, and handle an exception return or an SVC that
 * ended them. Returns the event that is left for cortex_m0_run(). */
static enum cortex_m0_event execute(struct cortex_m0 *cpu, uint64_t until)
{
    /* `longest` keeps the number of cycles to the deadline within a signed 64-bit number */
    const uint64_t due = cortex_m0_systick_due(cpu), longest = cpu->cycle + LONGEST_RUN;
    cpu->deadline = due < until ? due : until;
    cpu->deadline = cpu->deadline < longest ? cpu->deadline : longest;
    cpu->attention = false;
    enum cortex_m0_event event = cortex_m0_execute(cpu);
    if (event == CORTEX_M0_EVENT_EXIT) {
        event = cortex_m0_leave_exception(cpu);
    } else if (event == CORTEX_M0_EVENT_SVC) {
        call_supervisor(cpu);
        event = cpu->fault_pending ? CORTEX_M0_EVENT_FAULT : CORTEX_M0_EVENT_NONE;
    }
    cpu->fault_pending = event == CORTEX_M0_EVENT_FAULT;
    return event;
}

/* Handle faults, exception entries and sleep before instructions execute. An exception entry in progress waits until
 * the cycle entry_choice, in which its handler is chosen. Returns true if something was handled; the caller then calls
 * again. */
static bool handle_before_execution(struct cortex_m0 *cpu, uint64_t until)
{
    if (cpu->fault_pending) {
        cpu->fault_pending = false;
        cortex_m0_take_fault(cpu);
        return true;
    }
    if (cpu->entering) {
        advance_idle(cpu, until < cpu->entry_choice ? until : cpu->entry_choice);
        if (cpu->cycle == cpu->entry_choice) {
            cortex_m0_systick_settle(cpu, cpu->cycle);
            cortex_m0_finish_entry(cpu);
        }
        return true;
    }
    cortex_m0_systick_settle(cpu, cpu->cycle);
    if (cpu->asleep && !try_to_wake(cpu)) {
        const uint64_t due = cortex_m0_wake_cycle(cpu);
        advance_idle(cpu, due < until ? due : until);
        return true;
    }
    if (cortex_m0_next_exception(cpu, cpu->priority)) {
        cortex_m0_begin_entry(cpu);
        return true;
    }
    return false;
}

/* Return whether cortex_m0_run() has to return; writes the reason. A request for a reset or a stop is cleared. In
 * lockup, time passes until `until`, except in the run that reports the lockup first. */
static bool is_finished(struct cortex_m0 *cpu, uint64_t until, enum cortex_m0_reason *reason)
{
    if (cpu->reset_requested) {
        cpu->reset_requested = false;
        *reason = CORTEX_M0_RESET_REQUESTED;
        return true;
    }
    if (cpu->stop_requested) {
        cpu->stop_requested = false;
        *reason = CORTEX_M0_STOPPED;
        return true;
    }
    if (cpu->locked_up) {
        cpu->cycle = cpu->lockup_reported && until > cpu->cycle ? until : cpu->cycle;
        cpu->lockup_reported = true;
        *reason = CORTEX_M0_LOCKUP;
        return true;
    }
    *reason = cpu->asleep ? CORTEX_M0_ASLEEP : CORTEX_M0_DEADLINE;
    return cpu->cycle >= until;
}

/* Run until the cycle counter reaches `until`, or until another reason to return occurs, and return the reason. Before
 * each run of instructions, faults, exception entries and sleep are handled. */
enum cortex_m0_reason cortex_m0_run(struct cortex_m0 *cpu, uint64_t until)
{
    enum cortex_m0_reason reason;
    while (!is_finished(cpu, until, &reason)) {
        if (handle_before_execution(cpu, until)) {
            continue;
        }
        switch (execute(cpu, until)) {
        case CORTEX_M0_EVENT_FAULT:
            if (cpu->config.halt_on_fault) {
                return CORTEX_M0_FAULTED;
            }
            break;
        case CORTEX_M0_EVENT_BUS_RETRY:
            return CORTEX_M0_BUS_RETRY;
        case CORTEX_M0_EVENT_BREAKPOINT:
            return CORTEX_M0_BREAKPOINT;
        default:
            break;
        }
    }
    return reason;
}

/* Execute one instruction, or one exception entry together with its stacking cycles. Returns CORTEX_M0_DEADLINE, or
 * another reason that ended the step. */
enum cortex_m0_reason cortex_m0_step(struct cortex_m0 *cpu)
{
    enum cortex_m0_reason reason;
    do {
        reason = cortex_m0_run(cpu, cpu->cycle + 1u);
    } while (reason == CORTEX_M0_DEADLINE && (cpu->progress || cpu->entering));
    return reason;
}

/* End the current run of the processor after the instruction in progress; called from a callback. */
void cortex_m0_stop(struct cortex_m0 *cpu)
{
    cpu->stop_requested = true;
    cpu->attention = true;
}
