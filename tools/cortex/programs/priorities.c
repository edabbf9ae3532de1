/* Who runs when: interrupts pended by software, PendSV, SVC, SysTick, at all four priorities, with PRIMASK and in handlers. */
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
#define PERIOD 400000u /* long, so that a second tick is out of the question */

static volatile uint8_t log[LOG_SIZE];
static volatile unsigned logged, nests;
static volatile uint32_t raise_in[48], raise_system_in[48];

static void note(uint8_t what)
{
    log[logged++ % LOG_SIZE] = what;
}

static void barrier(void)
{
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

/* On the way in, out, and what was pended in between. */
static void handler_body(void)
{
    uint32_t number;
    __asm__ volatile("mrs %0, ipsr" : "=r"(number));
    note((uint8_t)number);
    nests++;
    const uint32_t irqs = raise_in[number], system = raise_system_in[number];
    raise_in[number] = raise_system_in[number] = 0;
    if (irqs || system) {
        __asm__ volatile("cpsid i");
        ISPR = irqs;
        ICSR = system;
        __asm__ volatile("cpsie i"); /* all at once, however soon a processor notices a pended one */
        barrier();
    }
    note((uint8_t)(0x80u | number));
    nests--;
}

void on_svcall(void) __attribute__((alias("handler_body")));
void on_pendsv(void) __attribute__((alias("handler_body")));
void on_systick(void) __attribute__((alias("handler_body")));
void on_irq0(void) __attribute__((alias("handler_body")));
void on_irq1(void) __attribute__((alias("handler_body")));
void on_irq2(void) __attribute__((alias("handler_body")));
void on_irq3(void) __attribute__((alias("handler_body")));

static void show(const char *name)
{
    put_text(name);
    put_text("\n");
    for (unsigned i = 0; i < logged; i++) {
        put_word(log[i] & 0x80u ? "    out" : "  in", log[i] & 0x7Fu);
    }
    logged = 0;
}

static void set(unsigned svcall, unsigned pendsv, unsigned systick, unsigned irq0, unsigned irq1, unsigned irq2, unsigned irq3)
{
    SHPR2 = svcall << 30;
    SHPR3 = systick << 30 | pendsv << 22;
    IPR0 = irq3 << 30 | irq2 << 22 | irq1 << 14 | irq0 << 6;
    barrier();
}

static void all_at_once(const char *name)
{
    __asm__ volatile("cpsid i");
    ISPR = 15;
    ICSR = PENDSVSET | PENDSTSET;
    put_word("ICSR", ICSR & ~(1u << 11)); /* RETTOBASE, which ARMv6-M does not have */
    put_word("ISPR", ISPR);
    __asm__ volatile("cpsie i");
    barrier();
    show(name);
}

static void in_each_other(const char *name)
{
    raise_in[16] = 2;
    raise_in[17] = 4;
    raise_in[18] = 8;
    raise_system_in[19] = PENDSVSET;
    raise_system_in[14] = PENDSTSET;
    ISPR = 1;
    barrier();
    show(name);
}

static void by_svc(const char *name)
{
    raise_in[11] = 5;
    raise_system_in[11] = PENDSVSET;
    __asm__ volatile("svc #1" ::: "memory");
    barrier();
    show(name);
}

static void registers(void)
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
    show("not enabled");
    ICPR = 4;
    put_word("ISPR", ISPR);
    ISER = 15;
    barrier();
    show("enabled again");
}

static void ticks(void)
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
    while (!logged) {
    }
    SYST_CSR = 0;
    show("by the timer");
}

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
        set(p[0], p[1], p[2], p[3], p[4], p[5], p[6]);
        all_at_once("all at once");
        in_each_other("in each other");
        by_svc("by SVC");
    }
    registers();
    ticks();
    put_word("nests", nests);
    return 0;
}
