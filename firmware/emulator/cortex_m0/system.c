/* Registers of the system control space, 0xE000E000 to 0xE000EFFF (ARM DDI 0419, B3). Only word accesses are allowed.
 */
#include "emulator/cortex_m0/internal.h"

#define SYST_CSR 0x010u
#define SYST_RVR 0x014u
#define SYST_CVR 0x018u
#define SYST_CALIB 0x01Cu
#define NVIC_ISER 0x100u
#define NVIC_ICER 0x180u
#define NVIC_ISPR 0x200u
#define NVIC_ICPR 0x280u
#define NVIC_IPR 0x400u
#define NVIC_IPR_END 0x420u
#define CPUID 0xD00u
#define ICSR 0xD04u
#define AIRCR 0xD0Cu
#define SCR 0xD10u
#define CCR 0xD14u
#define SHPR2 0xD1Cu
#define SHPR3 0xD20u

#define CPUID_CORTEX_M0_R0P0 0x410CC200u
#define CCR_STKALIGN_UNALIGN_TRP 0x208u

#define ICSR_NMIPENDSET (1u << 31)
#define ICSR_PENDSVSET (1u << 28)
#define ICSR_PENDSVCLR (1u << 27)
#define ICSR_PENDSTSET (1u << 26)
#define ICSR_PENDSTCLR (1u << 25)
#define ICSR_ISRPENDING (1u << 22)
#define ICSR_VECTPENDING_AT 12u

#define AIRCR_KEY 0x05FAu
#define AIRCR_KEY_READ 0xFA050000u
#define AIRCR_SYSRESETREQ 4u

#define SCR_SLEEPONEXIT 2u
#define SCR_SLEEPDEEP 4u
#define SCR_SEVONPEND 16u

/* Return the value of ICSR: active exception, next pending exception, and the pending bits of NMI, PendSV and
 * SysTick. */
static uint32_t read_interrupt_control(const struct cortex_m0 *cpu)
{
    const uint64_t pending = cpu->pending;
    return (uint32_t)cpu->ipsr | cortex_m0_next_exception(cpu, CORTEX_M0_PRIORITY_THREAD) << ICSR_VECTPENDING_AT |
           (pending >> CORTEX_M0_IRQ0 ? ICSR_ISRPENDING : 0) |
           (pending & CORTEX_M0_BIT(CORTEX_M0_SYSTICK) ? ICSR_PENDSTSET : 0) |
           (pending & CORTEX_M0_BIT(CORTEX_M0_PENDSV) ? ICSR_PENDSVSET : 0) |
           (pending & CORTEX_M0_BIT(CORTEX_M0_NMI) ? ICSR_NMIPENDSET : 0);
}

/* Return the priority register of four consecutive exceptions, from number `first` on: each level occupies the top two
 * bits of a byte. */
static uint32_t read_four_priorities(const struct cortex_m0 *cpu, unsigned first)
{
    uint32_t value = 0;
    for (unsigned i = 0; i < 4; i++) {
        value |= cortex_m0_level_of(cpu, first + i) << (8u * i + 6u);
    }
    return value;
}

/* Set the priorities of four consecutive exceptions, from number `first` on, from the top two bits of each byte. */
static void set_four_priorities(struct cortex_m0 *cpu, unsigned first, uint32_t value)
{
    for (unsigned i = 0; i < 4; i++) {
        cortex_m0_set_level(cpu, first + i, value >> (8u * i + 6u) & 3u);
    }
    cortex_m0_update_priority(cpu);
}

/* Return the value of a register of the system control space; unimplemented registers read as 0. SysTick must be
 * settled to the cycle of the access. Reading SYST_CSR clears COUNTFLAG. */
static uint32_t read_register(struct cortex_m0 *cpu, uint32_t offset)
{
    if (offset >= NVIC_IPR && offset < NVIC_IPR_END) {
        return read_four_priorities(cpu, CORTEX_M0_IRQ0 + offset - NVIC_IPR);
    }
    switch (offset) {
    case SYST_CSR: {
        const uint32_t control = cortex_m0_systick_control(cpu);
        cpu->systick.count_flag = false;
        return control;
    }
    case SYST_RVR:
        return cpu->systick.reload;
    case SYST_CVR:
        return cpu->systick.value;
    case SYST_CALIB:
        return cpu->config.systick_calibration;
    case NVIC_ISER:
    case NVIC_ICER:
        return (uint32_t)(cpu->enabled >> CORTEX_M0_IRQ0);
    case NVIC_ISPR:
    case NVIC_ICPR:
        return (uint32_t)(cpu->pending >> CORTEX_M0_IRQ0);
    case CPUID:
        return CPUID_CORTEX_M0_R0P0;
    case ICSR:
        return read_interrupt_control(cpu);
    case AIRCR:
        return AIRCR_KEY_READ;
    case SCR:
        return (cpu->sleep_on_exit ? SCR_SLEEPONEXIT : 0) | (cpu->deep_sleep ? SCR_SLEEPDEEP : 0) |
               (cpu->event_on_pending ? SCR_SEVONPEND : 0);
    case CCR:
        return CCR_STKALIGN_UNALIGN_TRP;
    case SHPR2:
        return cortex_m0_level_of(cpu, CORTEX_M0_SVCALL) << 30;
    case SHPR3:
        return cortex_m0_level_of(cpu, CORTEX_M0_SYSTICK) << 30 | cortex_m0_level_of(cpu, CORTEX_M0_PENDSV) << 22;
    default:
        return 0; /* debug and reserved registers */
    }
}

/* Write ICSR: NMIPENDSET, PENDSVSET and PENDSTSET make their exception pending; PENDSVCLR and PENDSTCLR end the pending
 * state. A set bit has precedence over the clear bit of the same exception. */
static void set_interrupt_control(struct cortex_m0 *cpu, uint32_t value, uint64_t cycle)
{
    const struct {
        uint32_t set, clear;
        unsigned number;
    } bits[] = {
        {ICSR_NMIPENDSET, 0, CORTEX_M0_NMI},
        {ICSR_PENDSVSET, ICSR_PENDSVCLR, CORTEX_M0_PENDSV},
        {ICSR_PENDSTSET, ICSR_PENDSTCLR, CORTEX_M0_SYSTICK},
    };
    for (size_t i = 0; i < sizeof bits / sizeof *bits; i++) {
        if (value & bits[i].set) {
            cortex_m0_set_pending(cpu, bits[i].number, cycle);
        } else if (value & bits[i].clear) {
            cpu->pending &= ~CORTEX_M0_BIT(bits[i].number);
        }
    }
}

/* Make the interrupts of the bit mask `irqs` pending as of `cycle`. */
static void pend_interrupts(struct cortex_m0 *cpu, uint32_t irqs, uint64_t cycle)
{
    for (uint32_t remaining = irqs; remaining; remaining &= remaining - 1u) {
        cortex_m0_set_pending(cpu, CORTEX_M0_IRQ0 + (unsigned)__builtin_ctz(remaining), cycle);
    }
}

/* End the pending state of the interrupts of the bit mask `irqs`. An interrupt whose input is still high stays pending,
 * unless its handler is active. */
static void unpend_interrupts(struct cortex_m0 *cpu, uint32_t irqs)
{
    const uint64_t held_by_line = (uint64_t)cpu->lines << CORTEX_M0_IRQ0 & ~cpu->active;
    cpu->pending &= ~((uint64_t)irqs << CORTEX_M0_IRQ0 & ~held_by_line);
}

/* Apply a value that the program wrote to SCR, the system control register with the settings of sleep modes. */
static void set_sleep_control(struct cortex_m0 *cpu, uint32_t value)
{
    cpu->sleep_on_exit = value & SCR_SLEEPONEXIT;
    cpu->deep_sleep = value & SCR_SLEEPDEEP;
    cpu->event_on_pending = value & SCR_SEVONPEND;
}

/* Write a register of the system control space in cycle `cycle`; unimplemented registers ignore the write. Any write to
 * SYST_CVR sets the counter to 0. */
static void write_register(struct cortex_m0 *cpu, uint32_t offset, uint64_t cycle, uint32_t value)
{
    if (offset >= NVIC_IPR && offset < NVIC_IPR_END) {
        set_four_priorities(cpu, CORTEX_M0_IRQ0 + offset - NVIC_IPR, value);
        return;
    }
    switch (offset) {
    case SYST_CSR:
        cortex_m0_systick_set_control(cpu, value);
        break;
    case SYST_RVR:
        cpu->systick.reload = value & 0xFFFFFFu;
        break;
    case SYST_CVR:
        cpu->systick.value = 0;
        cpu->systick.count_flag = false;
        break;
    case NVIC_ISER:
        cpu->enabled |= (uint64_t)value << CORTEX_M0_IRQ0;
        break;
    case NVIC_ICER:
        cpu->enabled &= ~((uint64_t)value << CORTEX_M0_IRQ0);
        break;
    case NVIC_ISPR:
        pend_interrupts(cpu, value, cycle);
        break;
    case NVIC_ICPR:
        unpend_interrupts(cpu, value);
        break;
    case ICSR:
        set_interrupt_control(cpu, value, cycle);
        break;
    case AIRCR:
        cpu->reset_requested |= value >> 16 == AIRCR_KEY && value & AIRCR_SYSRESETREQ;
        break;
    case SCR:
        set_sleep_control(cpu, value);
        break;
    case SHPR2:
        cortex_m0_set_level(cpu, CORTEX_M0_SVCALL, value >> 30);
        cortex_m0_update_priority(cpu);
        break;
    case SHPR3:
        cortex_m0_set_level(cpu, CORTEX_M0_SYSTICK, value >> 30);
        cortex_m0_set_level(cpu, CORTEX_M0_PENDSV, value >> 22 & 3u);
        cortex_m0_update_priority(cpu);
        break;
    default:
        break;
    }
}

/* Read the processor's register at 0xE000E000 + offset, as of the given cycle, at which the timer SysTick is
 * brought up to date. */
uint32_t cortex_m0_system_read(struct cortex_m0 *cpu, uint32_t offset, uint64_t cycle)
{
    cortex_m0_systick_settle(cpu, cycle);
    return read_register(cpu, offset);
}

/* Write `value` to the processor's register at 0xE000E000 + offset in the given cycle. */
void cortex_m0_system_write(struct cortex_m0 *cpu, uint32_t offset, uint64_t cycle, uint32_t value)
{
    cortex_m0_systick_settle(cpu, cycle);
    write_register(cpu, offset, cycle, value);
    cpu->attention = true; /* the write may have changed a deadline or made an exception due */
}
