/* Vector table and the code before main(). An application's table is at the start of RAM, because a Cortex-M0 has no
 * register for its position. The bootloader's table is at address 0. */
#include <stdint.h>
#include <string.h>

#include "boards/psoc4/regs/core.h"
#include "part/cpuss.h"

typedef void handler(void);

int main(void);
handler reset_handler, unexpected_handler, systick_handler, scb0_handler, scb1_handler, csd_handler;

extern uint32_t stack_top[], bss_begin[], bss_end[];

#ifdef IMAGE_APPLICATION
/* Handle unexpected exceptions and faults: store the address of the interrupted code in the fault record and wait for
 * the reset by the watchdog. Without a prologue, so that the stack pointer is the address of the exception frame. */
__attribute__((naked)) void unexpected_handler(void)
{
    __asm__ volatile("mov r0, sp\n\tbl fault_take_exception");
}
#else
/* Handle unexpected exceptions and faults: wait for the reset by the watchdog. */
void unexpected_handler(void)
{
    for (;;) {
    }
}
#endif

#define OR_UNEXPECTED __attribute__((weak, alias("unexpected_handler")))
OR_UNEXPECTED void scb0_handler(void);
OR_UNEXPECTED void scb1_handler(void);
OR_UNEXPECTED void csd_handler(void);

#define EXCEPTIONS 16u

_Static_assert(IRQ_SCB0 < IRQ_COUNT && IRQ_SCB1 < IRQ_COUNT,
               "enlarge IRQ_COUNT, and HANDOVER in image.ld.in behind it");
#ifdef IMAGE_APPLICATION
_Static_assert(IRQ_CSD < IRQ_COUNT, "enlarge IRQ_COUNT, and HANDOVER in image.ld.in behind it");
#endif

typedef union {
    handler *code;
    void *stack;
} vector;

#define VECTORS(section_name) __attribute__((section(section_name), used)) static const vector

#ifdef IMAGE_APPLICATION

/* The flash of an application holds only what its start needs. The table in RAM is filled in by reset_handler(): most
 * of its vectors are the same, and a table in flash would take 120 bytes more. */
VECTORS(".vectors.0") vectors_0_to_1[] = {{.stack = stack_top}, {reset_handler}};

static vector ram_vectors[EXCEPTIONS + IRQ_COUNT] __attribute__((section(".ram_vectors"), used));

#define SYSTICK_EXCEPTION 15u

/* Fill in the table of vectors in RAM and make the processor use it. The non-maskable interrupt (NMI) needs no own
 * vector: during a call of the supervisory ROM the processor uses the vector of the ROM (confirm). */
static void use_ram_vectors(void)
{
    for (unsigned i = 0; i < EXCEPTIONS + IRQ_COUNT; i++) {
        ram_vectors[i].code = unexpected_handler;
    }
    ram_vectors[SYSTICK_EXCEPTION].code = systick_handler;
    ram_vectors[EXCEPTIONS + IRQ_SCB0].code = scb0_handler;
    ram_vectors[EXCEPTIONS + IRQ_SCB1].code = scb1_handler;
#if IMAGE_DEVICE == 1
    ram_vectors[EXCEPTIONS + IRQ_CSD].code = csd_handler;
#endif
    CPUSS->config = CPUSS->config | CPUSS_CONFIG_VECS_IN_RAM;
}

#else

#define UNEXPECTED {unexpected_handler}

/* In three pieces: between them are vectors of exceptions that a Cortex-M0 does not have, and of interrupts that are
 * never enabled. The bootloader keeps constants there (image.ld.in). */
VECTORS(".vectors.0") vectors_0_to_3[] = {
    {.stack = stack_top},
    {reset_handler},
    UNEXPECTED, /* NMI: during a call of the supervisory ROM the processor uses the vector of the ROM (confirm) */
    UNEXPECTED, /* hard fault */
};
VECTORS(".vectors.2") vectors_11_to_15[] = {
    UNEXPECTED, /* SVC */
    UNEXPECTED, /* debug monitor: not in a Cortex-M0 */
    UNEXPECTED, /* reserved */
    UNEXPECTED, /* PendSV */
    {systick_handler},
};

#if IMAGE_DEVICE == 2

VECTORS(".vectors.4") interrupt_of_scb1[] = {{scb1_handler}};

#else

VECTORS(".vectors.4") interrupt_of_scb0[] = {{scb0_handler}};

#endif
#endif

/* First function after a reset: clear the variables and call main(). No image has variables with an initial value. An
 * application also uses a vector table in RAM and disables the interrupts that the bootloader left active. */
void reset_handler(void)
{
    memset(bss_begin, 0, (size_t)((uintptr_t)bss_end - (uintptr_t)bss_begin));
#ifdef IMAGE_APPLICATION
    use_ram_vectors();
    SYSTICK->control =
        0; /* the bootloader starts an image with interrupts off; SysTick and one interrupt are still active */
    SCS_ICSR = SCS_ICSR_SYSTICK_CLEAR;
    NVIC_ENABLE_CLEAR = ~0u;
    interrupts_unmask(0);
#endif
    (void)main();
    unexpected_handler();
}
