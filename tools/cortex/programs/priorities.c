/* Order of execution of exceptions: interrupts pended by software, PendSV, SVC and SysTick at all four priorities, with
 * PRIMASK and within handlers. */
#include "image.h"

#define REG(address) (*(volatile uint32_t *)(address))
#define SYST_CSR REG(0xE000E010)
#define SYST_RVR REG(0xE000E014)
#define SYST_CVR REG(0xE000E018)
#define ISER REG(0xE000E100)
#define ICER REG(0xE000E180)
#define ISPR REG(0xE000E200)
#define ICPR REG(0xE000E280)
#define IPR0 REG(0xE000E400)
#define ICSR REG(0xE000ED04)
#define SHPR2 REG(0xE000ED1C)
#define SHPR3 REG(0xE000ED20)
#define PENDSVSET (1u << 28)
#define PENDSTSET (1u << 26)
#define LOG_SIZE 64u
#define PERIOD 400000u /* long enough to exclude a second tick */

static volatile uint8_t log[LOG_SIZE];
static volatile unsigned log_count, nesting;
static volatile uint32_t raise_in[48], raise_system_in[48];

/* Append an event to the log: the exception number at an entry, with bit 7 set at an exit. */
static void log_event(uint8_t event)
{
    log[log_count++ % LOG_SIZE] = event;
}

/* Wait until all writes to the NVIC have taken effect, so that pending exceptions run before the next instruction. */
static void barrier(void)
{
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

/* Common handler of all exceptions: log the entry and the exit, and raise the exceptions that raise_in[] states for
 * this handler in between. */
static void handler_body(void)
{
    uint32_t number;
    __asm__ volatile("mrs %0, ipsr" : "=r"(number));
    log_event((uint8_t)number);
    nesting++;
    const uint32_t irqs = raise_in[number], system = raise_system_in[number];
    raise_in[number] = raise_system_in[number] = 0;
    if (irqs || system) {
        __asm__ volatile("cpsid i");
        ISPR = irqs;
        ICSR = system;
        /* raises all at once, independent of how soon a processor detects a pending exception */
        __asm__ volatile("cpsie i");
        barrier();
    }
    log_event((uint8_t)(0x80u | number));
    nesting--;
}

void on_svcall(void) __attribute__((alias("handler_body")));
void on_pendsv(void) __attribute__((alias("handler_body")));
void on_systick(void) __attribute__((alias("handler_body")));
void on_irq0(void) __attribute__((alias("handler_body")));
void on_irq1(void) __attribute__((alias("handler_body")));
void on_irq2(void) __attribute__((alias("handler_body")));
void on_irq3(void) __attribute__((alias("handler_body")));

/* Print the logged entries and exits of handlers, by exception number, and clear the log. */
static void print_log(const char *name)
{
    put_text(name);
    put_text("\n");
    for (unsigned i = 0; i < log_count; i++) {
        put_word(log[i] & 0x80u ? "    out" : "  in", log[i] & 0x7Fu);
    }
    log_count = 0;
}

/* Set the priority, 0 (highest) to 3, of each exception of the test. */
static void set_priorities(unsigned svcall, unsigned pendsv, unsigned systick, unsigned irq0, unsigned irq1,
                           unsigned irq2, unsigned irq3)
{
    SHPR2 = svcall << 30;
    SHPR3 = systick << 30 | pendsv << 22;
    IPR0 = irq3 << 30 | irq2 << 22 | irq1 << 14 | irq0 << 6;
    barrier();
}

/* Make four interrupts, PendSV and SysTick pending while PRIMASK masks them, unmask, and print the order in which they
 * run. */
static void raise_all_at_once(const char *name)
{
    __asm__ volatile("cpsid i");
    ISPR = 15;
    ICSR = PENDSVSET | PENDSTSET;
    put_word("ICSR", ICSR & ~(1u << 11)); /* RETTOBASE does not exist in ARMv6-M */
    put_word("ISPR", ISPR);
    __asm__ volatile("cpsie i");
    barrier();
    print_log(name);
}

/* Start a chain in which each handler raises the next exception, and print the order of entries and exits: preemption
 * or tail-chaining, depending on the priorities. raise_in[] is indexed by exception number (16: interrupt 0, 14:
 * PendSV) and contains a mask of interrupts. */
static void raise_in_handlers(const char *name)
{
    raise_in[16] = 2;
    raise_in[17] = 4;
    raise_in[18] = 8;
    raise_system_in[19] = PENDSVSET;
    raise_system_in[14] = PENDSTSET;
    ISPR = 1;
    barrier();
    print_log(name);
}

/* Raise two interrupts and PendSV in the SVC handler and print the order of entries and exits. */
static void raise_in_svc(const char *name)
{
    raise_in[11] = 5; /* exception 11: SVC; interrupts 0 and 2 */
    raise_system_in[11] = PENDSVSET;
    __asm__ volatile("svc #1" ::: "memory");
    barrier();
    print_log(name);
}

/* Print the NVIC registers after writes, and the handlers that run: a disabled interrupt stays pending until it is
 * enabled or cleared. The masks have one bit per interrupt: 5 disables interrupts 0 and 2 and makes them pending, and 4
 * clears interrupt 2 again. */
static void test_registers(void)
{
    put_word("IPR0", IPR0);
    put_word("SHPR2", SHPR2);
    put_word("SHPR3", SHPR3);
    put_word("ISER", ISER);
    ICER = 5;
    put_word("ISER", ISER);
    ISPR = 5;
    put_word("ISPR", ISPR);
    barrier();
    print_log("not enabled");
    ICPR = 4;
    put_word("ISPR", ISPR);
    ISER = 15;
    barrier();
    print_log("enabled again");
}

/* Wait for COUNTFLAG (bit 16 of SYST_CSR) without the SysTick interrupt (SYST_CSR 5: enabled, processor clock), then
 * enable the interrupt (7), raise interrupt 0 in the SysTick handler (exception 15), and print the order. */
static void test_systick(void)
{
    SYST_RVR = PERIOD;
    SYST_CVR = 0;
    SYST_CSR = 5;
    while (!(SYST_CSR & 1u << 16)) {
    }
    put_word("CSR", SYST_CSR);
    put_word("in range", SYST_CVR <= PERIOD);
    raise_in[15] = 1;
    SYST_CVR = 0;
    SYST_CSR = 7;
    while (!log_count) {
    }
    SYST_CSR = 0;
    print_log("raised in SysTick");
}

/* Print the order of execution of all exceptions for seven assignments of priorities, for comparison with QEMU. */
int main(void)
{
    ISER = 15;
    static const uint8_t priorities[][7] = {
        {0, 0, 0, 0, 0, 0, 0}, {3, 3, 2, 2, 1, 1, 0}, {0, 1, 2, 3, 3, 2, 1}, {1, 3, 0, 3, 2, 1, 0},
        {2, 2, 2, 1, 3, 0, 2}, {3, 0, 1, 0, 1, 2, 3}, {1, 1, 1, 2, 0, 2, 0},
    };
    for (unsigned i = 0; i < sizeof priorities / sizeof *priorities; i++) {
        const uint8_t *const p = priorities[i];
        put_word("PRIORITIES", i);
        set_priorities(p[0], p[1], p[2], p[3], p[4], p[5], p[6]);
        raise_all_at_once("all at once");
        raise_in_handlers("raised in handlers");
        raise_in_svc("raised in SVC");
    }
    test_registers();
    test_systick();
    put_word("nesting", nesting);
    return 0;
}
