/* Vector table and the code before main(). An application's table is copied to the start of RAM and used from there,
 * because a Cortex-M0 has no register for its position. The bootloader's table is at address 0. */
#include <stdint.h>
#include <string.h>

#include "boards/psoc4200/regs/core.h"
#include "boards/psoc4200/regs/cpuss.h"

typedef void handler(void);

int main(void);
handler reset_handler, unexpected_handler, systick_handler, scb0_handler, scb1_handler, csd_handler;

extern uint32_t stack_top[], data_begin[], data_end[], data_load[], bss_begin[], bss_end[];

/* Handler of unexpected exceptions and faults: waits for the reset by the watchdog. */
void unexpected_handler(void)
{
    for (;;) {
    }
}

#define OR_UNEXPECTED __attribute__((weak, alias("unexpected_handler")))
OR_UNEXPECTED void scb0_handler(void);
OR_UNEXPECTED void scb1_handler(void);
OR_UNEXPECTED void csd_handler(void);

#define EXCEPTIONS 16u

typedef union {
    handler *code;
    void *stack;
} vector;

#define UNEXPECTED {unexpected_handler}
#define VECTORS(section_name) __attribute__((section(section_name), used)) static const vector

/* In four pieces: between them are vectors of exceptions that a Cortex-M0 does not have, and of interrupts that are
 * never enabled. The bootloader keeps constants there (image.ld.in); in applications every one is unexpected. */
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

#ifdef IMAGE_APPLICATION

VECTORS(".vectors.1") vectors_4_to_10[] = {UNEXPECTED, UNEXPECTED, UNEXPECTED, UNEXPECTED,
                                           UNEXPECTED, UNEXPECTED, UNEXPECTED};
VECTORS(".vectors.3") interrupts_0_to_9[] = {UNEXPECTED, UNEXPECTED, UNEXPECTED, UNEXPECTED, UNEXPECTED,
                                             UNEXPECTED, UNEXPECTED, UNEXPECTED, UNEXPECTED, UNEXPECTED};
VECTORS(".vectors.4") interrupts_10_to_15[] = {{scb0_handler}, {scb1_handler}, UNEXPECTED,
                                               UNEXPECTED,     UNEXPECTED,     {csd_handler}};

_Static_assert(IRQ_SCB0 == 10 && IRQ_SCB1 == 11 && IRQ_CSD == 15, "the table has them in this order");
_Static_assert(IRQ_COUNT == 16, "the table ends with number 15");

extern const vector image_vectors[];
static vector ram_vectors[EXCEPTIONS + IRQ_COUNT] __attribute__((section(".ram_vectors"), used));

#elif IMAGE_DEVICE == 2

VECTORS(".vectors.4") interrupt_11[] = {{scb1_handler}};

#else

VECTORS(".vectors.4") interrupt_10[] = {{scb0_handler}};

#endif

/* First function after a reset: clear and initialise RAM and call main(). An application also moves its vector table to
 * RAM and disables the interrupts that the bootloader left active. */
void reset_handler(void)
{
    memset(bss_begin, 0, (size_t)((uintptr_t)bss_end - (uintptr_t)bss_begin));
#ifdef IMAGE_APPLICATION
    memcpy(data_begin, data_load,
           (size_t)((uintptr_t)data_end - (uintptr_t)data_begin)); /* a bootloader has no initialised data */
    memcpy(ram_vectors, image_vectors, sizeof ram_vectors);
    CPUSS->config = CPUSS->config | CPUSS_CONFIG_VECS_IN_RAM;
    SYSTICK->control =
        0; /* the bootloader starts an image with interrupts off; SysTick and one interrupt are still active */
    SCS_ICSR = SCS_ICSR_SYSTICK_CLEAR;
    NVIC_ENABLE_CLEAR = ~0u;
    interrupts_unmask(0);
#endif
    (void)main();
    unexpected_handler();
}
