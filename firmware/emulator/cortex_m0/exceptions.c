/* Exception entry and return (ARM DDI 0419, B1.5): stacking, late arrival, tail-chaining and lockup. */
#include "emulator/cortex_m0/internal.h"

#define EXC_RETURN_HANDLER 0xFFFFFFF1u
#define EXC_RETURN_MAIN 0xFFFFFFF9u
#define EXC_RETURN_PROCESS 0xFFFFFFFDu
#define FRAME_WORDS 8u
#define FRAME_SIZE (4u * FRAME_WORDS)
#define PSR_ALIGNED (1u << 9)
#define PSR_EXCEPTION 0x3Fu
#define LOCKUP_ADDRESS 0xFFFFFFFEu

/* Enter lockup: the processor no longer executes instructions until a reset. */
void cortex_m0_lock_up(struct cortex_m0 *cpu)
{
    cpu->locked_up = true;
    cpu->r[CORTEX_M0_PC] = LOCKUP_ADDRESS;
}

/* Make HardFault pending; a fault in HardFault or NMI locks the processor up. */
void cortex_m0_take_fault(struct cortex_m0 *cpu)
{
    if (cpu->priority <= CORTEX_M0_PRIORITY_HARD_FAULT) {
        cortex_m0_lock_up(cpu);
        return;
    }
    cortex_m0_set_pending(cpu, CORTEX_M0_HARD_FAULT, cpu->cycle);
}

/* Make HardFault pending at the present instruction, for a cause outside the program. In HardFault or NMI the processor
 * locks up. */
void cortex_m0_inject_fault(struct cortex_m0 *cpu)
{
    cpu->faults++;
    cortex_m0_take_fault(cpu);
}

/* Begin an exception entry: write the frame of eight words (registers and flags of the interrupted program) to the
 * stack in use. The frame begins at a multiple of 8 bytes; PSR_ALIGNED in the stored xPSR records that the stack
 * pointer was moved for this. The handler is chosen later, in cycle entry_choice, because a late exception of higher
 * priority can still replace the first one (late arrival). */
void cortex_m0_begin_entry(struct cortex_m0 *cpu)
{
    const uint32_t *const r = cpu->r;
    const uint32_t frame = (r[CORTEX_M0_SP] - FRAME_SIZE) & ~UINT32_C(4);
    const uint32_t xpsr = cortex_m0_xpsr(cpu) | (r[CORTEX_M0_SP] & 4u ? PSR_ALIGNED : 0);
    const uint32_t words[FRAME_WORDS] = {r[0], r[1], r[2], r[3], r[12], r[CORTEX_M0_LR], r[CORTEX_M0_PC], xpsr};
    cpu->entry_number = (uint8_t)cortex_m0_next_exception(cpu, cpu->priority);
    cpu->progress = 0; /* an interrupted register list restarts after the handler */
    cpu->entry_begin = cpu->cycle;
    bool stacked = true;
    for (unsigned i = 0; i < FRAME_WORDS && stacked; i++) {
        stacked = !cortex_m0_write(cpu, frame + 4u * i, 4, false, words[i]);
    }
    cortex_m0_set_sp(cpu, frame);
    cpu->entry_return = cpu->ipsr ? EXC_RETURN_HANDLER : cpu->process_stack ? EXC_RETURN_PROCESS : EXC_RETURN_MAIN;
    cortex_m0_use_stack(cpu, false);
    cpu->entering = true;
    cpu->entry_choice = cpu->cycle + cpu->config.timing.late_arrival;
    if (!stacked) {
        cpu->fault.kind = CORTEX_M0_FAULT_STACKING;
        cortex_m0_take_fault(cpu);
    }
}

/* Start the handler of exception `number` after stacking or tail-chaining: update the exception state and load the
 * vector. */
static void enter_handler(struct cortex_m0 *cpu, unsigned number)
{
    uint32_t vector;
    cortex_m0_account_begin(cpu, number, cpu->entry_begin);
    cpu->pending &= ~CORTEX_M0_BIT(number);
    cpu->active |= CORTEX_M0_BIT(number);
    cpu->ipsr = (uint8_t)number;
    cpu->event = true;
    cpu->r[CORTEX_M0_LR] = cpu->entry_return;
    cortex_m0_update_priority(cpu);
    if (cortex_m0_read(cpu, cpu->vector_base + 4u * number, 4, false, &vector)) {
        cpu->fault.kind = CORTEX_M0_FAULT_VECTOR;
        cortex_m0_take_fault(cpu);
        return;
    }
    cpu->thumb = vector & 1u;
    cortex_m0_set_fetch_address(cpu, vector & ~UINT32_C(1));
}

/* End an exception entry: start the handler of the pending exception with the highest priority. This exception may have
 * become pending during the stacking. */
void cortex_m0_finish_entry(struct cortex_m0 *cpu)
{
    const unsigned best = cortex_m0_next_exception(cpu, cpu->priority);
    cpu->entering = false;
    cpu->cycle = cpu->entry_choice + cpu->config.timing.exception_entry - cpu->config.timing.late_arrival;
    enter_handler(cpu, best ? best : cpu->entry_number);
}

/* Restore registers and flags from the exception frame at the stack pointer. to_thread: the return is to the main
 * program, not to another handler; the frame must contain exception number 0 exactly in this case. Returns the fault
 * event if the frame is invalid or cannot be read. */
static enum cortex_m0_event unstack(struct cortex_m0 *cpu, bool to_thread)
{
    uint32_t words[FRAME_WORDS], *const r = cpu->r;
    for (unsigned i = 0; i < FRAME_WORDS; i++) {
        if (cortex_m0_read(cpu, r[CORTEX_M0_SP] + 4u * i, 4, false, &words[i])) {
            cpu->fault.kind = CORTEX_M0_FAULT_STACKING;
            return CORTEX_M0_EVENT_FAULT;
        }
    }
    const uint32_t psr = words[FRAME_WORDS - 1u];
    if (to_thread != !(psr & PSR_EXCEPTION)) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_RETURN, psr);
    }
    memcpy(r, words, 4u * sizeof *r);
    r[12] = words[4];
    r[CORTEX_M0_LR] = words[5];
    r[CORTEX_M0_SP] = (r[CORTEX_M0_SP] + FRAME_SIZE) | (psr & PSR_ALIGNED ? 4u : 0);
    cortex_m0_set_xpsr(cpu, psr);
    cpu->ipsr = (uint8_t)(psr & PSR_EXCEPTION);
    cpu->cycle += cpu->config.timing.exception_return;
    cortex_m0_set_fetch_address(cpu, words[6] & ~UINT32_C(1));
    return CORTEX_M0_EVENT_NONE;
}

/* Return whether an EXC_RETURN value fits the active exceptions: a return to a handler needs another active exception,
 * a return to thread mode must end the last one. */
static bool is_valid_return(const struct cortex_m0 *cpu, uint32_t value)
{
    const uint64_t other_active = cpu->active & ~CORTEX_M0_BIT(cpu->ipsr);
    switch (value) {
    case EXC_RETURN_HANDLER:
        return other_active;
    case EXC_RETURN_MAIN:
    case EXC_RETURN_PROCESS:
        return !other_active;
    default:
        return false;
    }
}

/* End the active state of an exception. An interrupt whose input is still high becomes pending again. */
static void deactivate(struct cortex_m0 *cpu, unsigned number)
{
    cpu->active &= ~CORTEX_M0_BIT(number);
    cortex_m0_update_priority(cpu);
    if (number >= CORTEX_M0_IRQ0 && cpu->lines >> (number - CORTEX_M0_IRQ0) & 1u) {
        cortex_m0_set_pending(cpu, number, cpu->cycle);
    }
}

/* Return from the handler of the exception in IPSR, with the EXC_RETURN value in exit_value. A pending exception of
 * sufficient priority is entered without unstacking (tail-chaining). Returns the fault event if the value or the frame
 * is invalid. */
enum cortex_m0_event cortex_m0_leave_exception(struct cortex_m0 *cpu)
{
    const uint32_t value = cpu->exit_value;
    const unsigned number = cpu->ipsr;
    cpu->r[CORTEX_M0_PC] = value;
    if (!(cpu->active & CORTEX_M0_BIT(number)) || !is_valid_return(cpu, value)) {
        return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_RETURN, value);
    }
    deactivate(cpu, number);
    cpu->event = true;
    const unsigned next_number = cortex_m0_next_exception(cpu, cpu->priority);
    if (next_number) {
        cortex_m0_account_end(cpu, number, cpu->cycle);
        cpu->entry_begin = cpu->cycle;
        cpu->entry_return = value;
        cpu->cycle += cpu->config.timing.tail_chain;
        enter_handler(cpu, next_number);
        return CORTEX_M0_EVENT_NONE;
    }
    cortex_m0_use_stack(cpu, value == EXC_RETURN_PROCESS);
    const enum cortex_m0_event event = unstack(cpu, value != EXC_RETURN_HANDLER);
    cortex_m0_account_end(cpu, number, cpu->cycle);
    if (event) {
        /* The frame is invalid, so its exception number is unavailable. */
        cpu->ipsr = cpu->active ? (uint8_t)__builtin_ctzll(cpu->active) : 0;
    } else if (!cpu->ipsr && cpu->sleep_on_exit) {
        cortex_m0_sleep(cpu, false);
    }
    return event;
}
