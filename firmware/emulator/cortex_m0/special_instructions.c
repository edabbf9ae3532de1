/* Infrequent instructions outside the fast path: special registers, hints, and the program counter or stack pointer as
 * an operand of general instructions. */
#include "emulator/cortex_m0/internal.h"

enum special_register { LAST_PSR = 7, SYS_MSP = 8, SYS_PSP = 9, SYS_PRIMASK = 16, SYS_CONTROL = 20 };

#define CONTROL_SPSEL 2u
#define APSR_FLAGS 0xF0000000u
#define WAIT_CYCLES 2u

/* Complete an instruction: advances the program counter by `bytes` and the cycle counter by `cycles`. Returns no
 * event. */
static enum cortex_m0_event finish_instruction(struct cortex_m0 *cpu, uint32_t bytes, uint32_t cycles)
{
    cpu->r[CORTEX_M0_PC] += bytes;
    cpu->cycle += cycles;
    return CORTEX_M0_EVENT_NONE;
}

/* Complete a jump to `address` (bit 0 is ignored), in `extra` cycles more than a taken branch. Returns no event. */
static enum cortex_m0_event finish_jump(struct cortex_m0 *cpu, uint32_t address, uint32_t extra)
{
    cpu->cycle += cpu->config.timing.taken_branch + extra;
    cortex_m0_set_fetch_address(cpu, address & ~UINT32_C(1));
    return CORTEX_M0_EVENT_NONE;
}

/* Record the fault of an undefined instruction at the present program counter. Returns the event of the fault. */
static enum cortex_m0_event record_undefined(struct cortex_m0 *cpu)
{
    return cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_UNDEFINED, cpu->r[CORTEX_M0_PC]);
}

/* Execute ADD or MOV with PC or SP as an operand or destination. PC reads as the address of the instruction plus 4. */
static enum cortex_m0_event execute_any_registers(struct cortex_m0 *cpu, uint32_t half)
{
    const uint32_t d = (half & 7u) | (half >> 4 & 8u), m = half >> 3 & 15u, pc = cpu->r[CORTEX_M0_PC] + 4u;
    const uint32_t first = d == CORTEX_M0_PC ? pc : cpu->r[d], second = m == CORTEX_M0_PC ? pc : cpu->r[m];
    const uint32_t result = half >> 8 & 2u ? second : first + second;
    if (d == CORTEX_M0_PC) {
        return finish_jump(cpu, result, 0);
    }
    if (d == CORTEX_M0_SP) {
        cortex_m0_set_sp(cpu, result);
    } else {
        cpu->r[d] = result;
    }
    return finish_instruction(cpu, 2, 1);
}

/* Execute a hint instruction: WFE or WFI, which put the processor to sleep, or SEV, which sets the event register.
 * WFE does not sleep if the event register is set, but clears it. */
static enum cortex_m0_event execute_hint(struct cortex_m0 *cpu, uint32_t half)
{
    enum { WFE = 2, WFI = 3 };
    const unsigned number = half >> 4 & 15u;
    if (number != WFE && number != WFI) {
        cpu->event = true; /* SEV */
        return finish_instruction(cpu, 2, 1);
    }
    finish_instruction(cpu, 2, WAIT_CYCLES);
    if (number == WFE && cpu->event) {
        cpu->event = false;
        return CORTEX_M0_EVENT_NONE;
    }
    cortex_m0_sleep(cpu, number == WFE);
    return CORTEX_M0_EVENT_NONE;
}

/* Execute MRS: r[d] = special register `number`. Unknown numbers and the destinations SP and PC are unpredictable and
 * handled as undefined instructions, for which the function returns the fault event. The numbers 0 to 7 are
 * combinations of the parts of xPSR: bit 2 of the number excludes the flags, bit 0 includes the exception number;
 * number 4 does not exist. */
static enum cortex_m0_event read_special(struct cortex_m0 *cpu, uint32_t d, uint32_t number)
{
    const uint32_t xpsr = cortex_m0_xpsr(cpu);
    uint32_t value;
    switch (number) {
    case SYS_MSP:
        value = cortex_m0_msp(cpu);
        break;
    case SYS_PSP:
        value = cortex_m0_psp(cpu);
        break;
    case SYS_PRIMASK:
        value = cpu->primask;
        break;
    case SYS_CONTROL:
        value = cpu->process_stack ? CONTROL_SPSEL : 0;
        break;
    default:
        if (number > LAST_PSR || number == 4) {
            return record_undefined(cpu);
        }
        value = (number & 4u ? 0 : xpsr & APSR_FLAGS) | (number & 1u ? cpu->ipsr : 0); /* the T bit is read as 0 */
        break;
    }
    if (d == CORTEX_M0_SP || d == CORTEX_M0_PC) {
        return record_undefined(cpu);
    }
    cpu->r[d] = value;
    return finish_instruction(cpu, 4, cpu->config.timing.special);
}

/* Write MSP or PSP (`process`), whether or not that stack is in use, and update its low-water mark. */
static void set_stack_pointer(struct cortex_m0 *cpu, bool process, uint32_t value)
{
    if (process == cpu->process_stack) {
        cortex_m0_set_sp(cpu, value);
        return;
    }
    cpu->other_sp = value & ~UINT32_C(3);
    cpu->other_lowest_sp = cpu->other_sp < cpu->other_lowest_sp ? cpu->other_sp : cpu->other_lowest_sp;
}

/* Execute MSR: special register `number` = r[n]. Writes to IPSR and EPSR have no effect, and CONTROL can change only in
 * thread mode. Of the numbers 0 to 7 (combinations of the parts of xPSR), those without bit 2 write the flags; number 4
 * does not exist. Returns the fault event for unknown numbers and for the sources SP and PC. */
static enum cortex_m0_event write_special(struct cortex_m0 *cpu, uint32_t n, uint32_t number)
{
    if (n == CORTEX_M0_SP || n == CORTEX_M0_PC) {
        return record_undefined(cpu);
    }
    const uint32_t value = cpu->r[n];
    switch (number) {
    case SYS_MSP:
    case SYS_PSP:
        set_stack_pointer(cpu, number == SYS_PSP, value);
        break;
    case SYS_PRIMASK:
        cpu->primask = value & 1u;
        cortex_m0_update_priority(cpu);
        break;
    case SYS_CONTROL:
        if (!cpu->ipsr) {
            cortex_m0_use_stack(cpu, value & CONTROL_SPSEL);
        }
        break;
    default:
        if (number > LAST_PSR || number == 4) {
            return record_undefined(cpu);
        }
        if (!(number & 4u)) {
            cortex_m0_set_xpsr(cpu, (value & APSR_FLAGS) | (cortex_m0_xpsr(cpu) & ~APSR_FLAGS));
        }
        break;
    }
    return finish_instruction(cpu, 4, cpu->config.timing.special);
}

/* Execute B, B<cond> or BL whose target lies in another memory or in none. */
static enum cortex_m0_event execute_far_branch(struct cortex_m0 *cpu, uint32_t half, uint32_t second)
{
    const uint32_t pc = cpu->r[CORTEX_M0_PC] + 4u;
    if (half >> 12 == 0xDu) { /* B<cond> */
        const bool taken = cortex_m0_condition(cpu, half >> 8 & 15u);
        return taken ? finish_jump(cpu, pc + (uint32_t)cortex_m0_sign_extend(half & 0xFFu, 8) * 2u, 0)
                     : finish_instruction(cpu, 2, 1);
    }
    if (half >> 12 == 0xEu) { /* B */
        return finish_jump(cpu, pc + (uint32_t)cortex_m0_sign_extend(half & 0x7FFu, 11) * 2u, 0);
    }
    cpu->r[CORTEX_M0_LR] = pc | 1u; /* BL */
    return finish_jump(cpu, pc + (uint32_t)cortex_m0_link_offset(half, second), 1);
}

/* Execute a 32-bit instruction outside the fast path: a far BL, MRS, MSR or a barrier. */
static enum cortex_m0_event execute_wide(struct cortex_m0 *cpu, uint32_t half, uint32_t second)
{
    if ((second & 0xD000u) == 0xD000u) { /* BL */
        return execute_far_branch(cpu, half, second);
    }
    if (half == 0xF3EFu) { /* MRS */
        return read_special(cpu, second >> 8 & 15u, second & 0xFFu);
    }
    /* 0xF3BF: a barrier (DSB, DMB or ISB) */
    return half == 0xF3BFu ? finish_instruction(cpu, 4, cpu->config.timing.special)
                           : write_special(cpu, half & 15u, second & 0xFFu);
}

/* Execute the instruction at r[15], which the decoder has classified as outside the fast path: far branches, SVC, BKPT,
 * CPS, hints, MRS, MSR, barriers, and ADD or MOV with PC or SP. Returns the event that the instruction causes, or
 * CORTEX_M0_EVENT_NONE. */
enum cortex_m0_event cortex_m0_execute_special(struct cortex_m0 *cpu)
{
    const struct cortex_m0_code *const code = cortex_m0_code_at(cpu, cpu->r[CORTEX_M0_PC]);
    const uint8_t *const bytes = code->bytes + (cpu->r[CORTEX_M0_PC] - code->base);
    const uint32_t half = cortex_m0_read_half(bytes);
    switch (half >> 12) {
    case 0x4:
        return execute_any_registers(cpu, half);
    case 0xB:
        if (half >> 8 == 0xBFu) {
            return execute_hint(cpu, half);
        }
        if (half >> 8 == 0xBEu) {
            return cpu->config.halt_on_breakpoint
                       ? CORTEX_M0_EVENT_BREAKPOINT
                       : cortex_m0_record_fault(cpu, CORTEX_M0_FAULT_BREAKPOINT, cpu->r[CORTEX_M0_PC]);
        }
        cpu->primask = half & 0x10u; /* CPS */
        cortex_m0_update_priority(cpu);
        return finish_instruction(cpu, 2, 1);
    case 0xD:
        return half >> 8 == 0xDFu ? CORTEX_M0_EVENT_SVC : execute_far_branch(cpu, half, 0);
    case 0xE:
        return execute_far_branch(cpu, half, 0);
    default:
        return execute_wide(cpu, half, cortex_m0_read_half(bytes + 2));
    }
}
