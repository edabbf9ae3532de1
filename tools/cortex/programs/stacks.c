/* Both stacks, special registers, frames at unaligned stack pointers, and returns from nested handlers to either stack.
 */
#include "image.h"

#define ICSR (*(volatile uint32_t *)0xE000ED04)
#define PENDSVSET (1u << 28)

static uint32_t process_stack[64];
static volatile uint32_t restored[4];

#define READ(name, special) \
    do { \
        uint32_t value_; \
        __asm__ volatile("mrs %0, " special : "=r"(value_)); \
        put_word(name, value_); \
    } while (0)

/* Print the frame that the processor stacked for an exception, and the special registers. msp: MSP at entry;
 * exc_return: EXC_RETURN. */
__attribute__((used)) static void report_frame(uint32_t msp, uint32_t exc_return)
{
    uint32_t psp;
    __asm__ volatile("mrs %0, psp" : "=r"(psp));
    put_word("  EXC_RETURN", exc_return);
    put_word("  MSP modulo 8", msp % 8u);
    put_word("  PSP modulo 8", psp % 8u);
    const uint32_t *const frame = (const uint32_t *)(exc_return & 4u ? psp : msp);
    for (unsigned i = 0; i < 5; i++) {
        put_word("  stacked", frame[i]);
    }
    put_word("  xPSR", frame[7]);
    READ("  CONTROL", "control");
    READ("  IPSR", "ipsr");
}

/* Body of an exception handler: pass the main stack pointer at entry and EXC_RETURN to report_frame(). */
#define ENTER \
    __asm__ volatile("mov r0, sp\n\t" \
                     "mov r1, lr\n\t" \
                     "push {r0, lr}\n\t" \
                     "bl report_frame\n\t" \
                     "pop {r0, pc}")

/* SVC handler: report the stacked frame. Naked, because a compiled prologue would move the stack pointer. */
__attribute__((naked)) void on_svcall(void)
{
    ENTER;
}

/* PendSV handler: report the stacked frame, as the SVC handler does. */
__attribute__((naked)) void on_pendsv(void)
{
    ENTER;
}

/* Sets registers to known values, pushes `words` words, calls SVC and stores the registers afterwards. */
#define CALL(words) \
    __asm__ volatile("movs r0, #10\n\tmovs r1, #11\n\tmovs r2, #12\n\tmovs r3, #13\n\tmov r12, r3\n\t" \
                     "sub sp, #4 * " #words "\n\t" \
                     "cmp r0, r1\n\t" \
                     "svc #0\n\t" \
                     "add sp, #4 * " #words "\n\t" \
                     "ldr r4, =restored\n\tstm r4!, {r0-r3}" \
                     : \
                     : \
                     : "r0", "r1", "r2", "r3", "r4", "r12", "cc", "memory")

/* Print r0 to r3 after an exception, which the return must have restored from the frame. */
static void print_restored(const char *name)
{
    put_text(name);
    put_text("\n");
    for (unsigned i = 0; i < 4; i++) {
        put_word("  restored", restored[i]);
    }
}

/* Write and read the special registers: bits that do not exist must read as 0. */
static void test_special_registers(void)
{
    uint32_t value;
    __asm__ volatile("msr apsr_nzcvq, %1\n\tmrs %0, apsr" : "=r"(value) : "r"(0xA5A5A5A5u) : "cc");
    put_word("APSR", value & 0xF0000000u);
    __asm__ volatile("msr primask, %1\n\tmrs %0, primask" : "=r"(value) : "r"(0xFFFFFFFFu));
    put_word("PRIMASK", value);
    __asm__ volatile("msr primask, %0" ::"r"(0));
    READ("PRIMASK", "primask");
    READ("EPSR", "epsr");
    READ("CONTROL", "control");
}

/* Call SVC and PendSV with the main and the process stack, at stack pointers that are a multiple of 8 and that are not,
 * and print frames and restored registers. CALL(n) pushes n words before the SVC: with one word ("odd") the stack
 * pointer is no multiple of 8. */
int main(void)
{
    test_special_registers();
    CALL(2);
    print_restored("main stack");
    CALL(1);
    print_restored("main stack, odd");
    __asm__ volatile("msr psp, %0" ::"r"(process_stack + 64));
    __asm__ volatile("movs r0, #2\n\tmsr control, r0\n\tisb" ::: "r0", "memory");
    READ("CONTROL", "control");
    CALL(2);
    print_restored("process stack");
    CALL(1);
    print_restored("process stack, odd");
    register uint32_t r0 __asm__("r0") = PENDSVSET;
    register volatile uint32_t *r1 __asm__("r1") = &ICSR;
    __asm__ volatile("movs r2, #0\n\tmovs r3, #0\n\tmov r12, r3\n\tstr r0, [r1]\n\tdsb\n\tisb" ::"r"(r0), "r"(r1)
                     : "r2", "r3", "r12", "memory");
    print_restored("PendSV");
    __asm__ volatile("movs r0, #0\n\tmsr control, r0\n\tisb" ::: "r0", "memory");
    READ("CONTROL", "control");
    return 0;
}
