/* The processor's own registers, the same in a Cortex-M0 and a Cortex-M0+: interrupt controller, system tick, system
 * control. Source: ARMv6-M Architecture Reference Manual (DDI 0419), B3. */
#ifndef PSOC4_REGS_CORE_H
#define PSOC4_REGS_CORE_H

#include <stddef.h>
#include <stdint.h>

#include "part/numbers.h"

struct systick_regs {
    volatile uint32_t control;
    volatile uint32_t reload;
    volatile uint32_t value;
};

_Static_assert(offsetof(struct systick_regs, value) == 0x08, "SYST_CVR is at 0xE000E018");

#define SYSTICK ((struct systick_regs *)0xE000E010u)
#define SYSTICK_CONTROL_ENABLE (1u << 0)
#define SYSTICK_CONTROL_INTERRUPT (1u << 1)
#define SYSTICK_CONTROL_PROCESSOR_CLOCK (1u << 2)

#define NVIC_ENABLE_SET (*(volatile uint32_t *)0xE000E100u)
#define NVIC_ENABLE_CLEAR (*(volatile uint32_t *)0xE000E180u)
#define NVIC_PENDING_SET (*(volatile uint32_t *)0xE000E200u) /* read: the pending interrupts */
#define NVIC_PENDING_CLEAR (*(volatile uint32_t *)0xE000E280u)
/* One byte per interrupt, of which only the two high bits exist. */
#define NVIC_PRIORITY ((volatile uint32_t *)0xE000E400u)

#define SCS_ICSR (*(volatile uint32_t *)0xE000ED04u)
#define SCS_ICSR_SYSTICK_PENDING (1u << 26)
#define SCS_ICSR_SYSTICK_CLEAR (1u << 25)
#define SCS_AIRCR (*(volatile uint32_t *)0xE000ED0Cu)
#define SCS_AIRCR_RESET 0x05FA0004u

#ifdef IMAGE_APPLICATION
#define IRQ_COUNT 16 /* vectors that an image has; the parts have more interrupts */
#else
#define IRQ_COUNT 12 /* the bootloader needs no CapSense */
#endif

/* Mask all interrupts. Returns the previous state of the mask, for interrupts_unmask(). */
static inline uint32_t interrupts_mask(void)
{
    uint32_t state;
    __asm__ volatile("mrs %0, primask" : "=r"(state));
    __asm__ volatile("cpsid i" ::: "memory");
    return state;
}

/* Return the number of the exception whose handler runs: 3 HardFault, 16 + n interrupt n; 0 outside handlers. */
static inline uint32_t current_exception(void)
{
    uint32_t number;
    __asm__ volatile("mrs %0, ipsr" : "=r"(number));
    return number;
}

/* Restore the state of the interrupt mask; 0 permits interrupts. */
static inline void interrupts_unmask(uint32_t state)
{
    __asm__ volatile("msr primask, %0" ::"r"(state) : "memory");
}

/* Sleep until an interrupt is pending, even if it is masked. */
static inline void wait_for_interrupt(void)
{
    __asm__ volatile("wfi" ::: "memory");
}

/* Enable an interrupt and set its priority. On a board, all peripherals interrupt at level 1, so that none preempts
 * another; SysTick keeps level 0 and may preempt them. In the hub and the bootloaders every interrupt keeps level 0,
 * the state after a reset, because nesting would take more stack. */
static inline void interrupt_enable(unsigned number)
{
#if defined IMAGE_APPLICATION && IMAGE_DEVICE == 1
    volatile uint32_t *const word = &NVIC_PRIORITY[number >> 2];
    *word = (*word & ~(0xFFu << (8u * (number & 3u)))) | (0x40u << (8u * (number & 3u)));
#endif
#ifdef IMAGE_APPLICATION
    NVIC_PENDING_CLEAR = 1u << number;
#endif
    NVIC_ENABLE_SET = 1u << number;
}

/* Disable an interrupt. */
static inline void interrupt_disable(unsigned number)
{
    NVIC_ENABLE_CLEAR = 1u << number;
}

#endif
