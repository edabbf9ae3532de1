/* The flags, stored as the values from which they are derived, and the two stack pointers. */
#include "emulator/cortex_m0/internal.h"

#define FLAG_N (1u << 31)
#define FLAG_Z (1u << 30)
#define FLAG_C (1u << 29)
#define FLAG_V (1u << 28)
#define FLAG_T (1u << 24)

/* Assemble xPSR. N, Z and V are stored as the result words from which they are derived, which is faster than single
 * bits. */
uint32_t cortex_m0_xpsr(const struct cortex_m0 *cpu)
{
    return (cpu->n & FLAG_N) | (cpu->z ? 0 : FLAG_Z) | (cpu->c ? FLAG_C : 0) | (cpu->v >> 31 ? FLAG_V : 0) |
           (cpu->thumb ? FLAG_T : 0) | cpu->ipsr;
}

/* Set the flags and the T bit from a value of xPSR; the exception number is not changed. N and V are stored as bit 31
 * of the words n and v, Z as a word z that is 0 if Z is set. */
void cortex_m0_set_xpsr(struct cortex_m0 *cpu, uint32_t xpsr)
{
    cpu->n = xpsr;
    cpu->z = !(xpsr & FLAG_Z);
    cpu->c = xpsr >> 29 & 1u;
    cpu->v = xpsr << 3;
    cpu->thumb = xpsr & FLAG_T;
}

/* Return whether a condition code of the manual (0 EQ to 13 LE) holds; an odd code is the inverse of the code before
 * it. */
bool cortex_m0_condition(const struct cortex_m0 *cpu, unsigned condition)
{
    const bool z = cpu->z == 0, c = cpu->c, n = cpu->n >> 31, v = cpu->v >> 31;
    const bool results[] = {z, c, n, v, c && !z, n == v, !z && n == v}; /* EQ, CS, MI, VS, HI, GE, GT */
    return results[condition / 2u] != (condition & 1u);
}

/* Select the process stack (PSP) or the main stack (MSP) as r[13], and store pointer and low-water mark of the other
 * stack. */
void cortex_m0_use_stack(struct cortex_m0 *cpu, bool process)
{
    if (process == cpu->process_stack) {
        return;
    }
    const uint32_t sp = cpu->r[CORTEX_M0_SP], lowest = cpu->lowest_sp;
    cpu->r[CORTEX_M0_SP] = cpu->other_sp;
    cpu->lowest_sp = cpu->other_lowest_sp;
    cpu->other_sp = sp;
    cpu->other_lowest_sp = lowest;
    cpu->process_stack = process;
}

/* Return the main stack pointer, also while the processor uses the process stack. */
uint32_t cortex_m0_msp(const struct cortex_m0 *cpu)
{
    return cpu->process_stack ? cpu->other_sp : cpu->r[CORTEX_M0_SP];
}

/* Return the process stack pointer, also while the processor uses the main stack. */
uint32_t cortex_m0_psp(const struct cortex_m0 *cpu)
{
    return cpu->process_stack ? cpu->r[CORTEX_M0_SP] : cpu->other_sp;
}

/* Return the lowest value that the main stack pointer has had since the last reset of the marks. */
uint32_t cortex_m0_lowest_msp(const struct cortex_m0 *cpu)
{
    return cpu->process_stack ? cpu->other_lowest_sp : cpu->lowest_sp;
}

/* Return the lowest value that the process stack pointer has had since the last reset of the marks. */
uint32_t cortex_m0_lowest_psp(const struct cortex_m0 *cpu)
{
    return cpu->process_stack ? cpu->lowest_sp : cpu->other_lowest_sp;
}

/* Set the lowest values of both stack pointers to their present values, to measure the stack depth from here
 * on. */
void cortex_m0_reset_stack_marks(struct cortex_m0 *cpu)
{
    cpu->lowest_sp = cpu->r[CORTEX_M0_SP];
    cpu->other_lowest_sp = cpu->other_sp ? cpu->other_sp : UINT32_MAX; /* 0: PSP was never set */
}
