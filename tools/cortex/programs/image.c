/* Start-up code of a program: vectors, initialisation of memory, call of main(), and end. */
#include "image.h"

enum { SYS_WRITE0 = 4, SYS_EXIT = 0x18, APPLICATION_EXIT = 0x20026 };

extern uint32_t stack_top, data_begin, data_end, data_source, bss_begin, bss_end;

/* Call the host by semihosting: BKPT 0xAB with the operation in r0 and its argument in r1. */
static uint32_t call_host(uint32_t operation, uint32_t argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uint32_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* Print a zero-terminated string by semihosting. */
void put_text(const char *text)
{
    call_host(SYS_WRITE0, (uint32_t)text);
}

/* Print one line: a name and a value in eight hexadecimal digits. */
void put_word(const char *name, uint32_t value)
{
    char text[] = " 00000000\n";
    for (unsigned i = 0; i < 8; i++) {
        text[8 - i] = "0123456789abcdef"[value >> 4 * i & 15u];
    }
    put_text(name);
    put_text(text);
}

/* End the program by semihosting; the loop repeats the call in case the host ignores it. */
void end(void)
{
    for (;;) {
        call_host(SYS_EXIT, APPLICATION_EXIT);
    }
}

/* Reset handler: copy initialised data from flash to RAM, clear the other variables, call main() and end the program.
 */
static void start(void)
{
    for (uint32_t *to = &data_begin, *from = &data_source; to < &data_end;) {
        *to++ = *from++;
    }
    for (uint32_t *to = &bss_begin; to < &bss_end;) {
        *to++ = 0;
    }
    main();
    end();
}

/* Default exception handler: print the exception number (IPSR) and end the program. */
static void report_unexpected(void)
{
    uint32_t number;
    __asm__ volatile("mrs %0, ipsr" : "=r"(number));
    put_word("unexpected exception", number);
    end();
}

void on_nmi(void) __attribute__((weak, alias("report_unexpected")));
void on_hard_fault(void) __attribute__((weak, alias("report_unexpected")));
void on_svcall(void) __attribute__((weak, alias("report_unexpected")));
void on_pendsv(void) __attribute__((weak, alias("report_unexpected")));
void on_systick(void) __attribute__((weak, alias("report_unexpected")));
void on_irq0(void) __attribute__((weak, alias("report_unexpected")));
void on_irq1(void) __attribute__((weak, alias("report_unexpected")));
void on_irq2(void) __attribute__((weak, alias("report_unexpected")));
void on_irq3(void) __attribute__((weak, alias("report_unexpected")));

__attribute__((section(".vectors"), used)) static handler *const vectors[48] = {
    (handler *)&stack_top,
    start,
    on_nmi,
    on_hard_fault,
    [11] = on_svcall,
    [14] = on_pendsv,
    on_systick,
    on_irq0,
    on_irq1,
    on_irq2,
    on_irq3,
};
