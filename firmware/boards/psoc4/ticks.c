/* SysTick counts SYSCLK down and wraps after a power of two of microseconds, so that whole wraps convert by a shift.
 * Callers may have interrupts off: one pending wrap is taken into account, but not several. */
#include "boards/psoc4/ticks.h"

#include "boards/psoc4/clocks.h"
#include "boards/psoc4/regs/core.h"

#ifdef IMAGE_APPLICATION
#define US_SHIFT 12u
#else
#define US_SHIFT 10u
#endif
#define CYCLES_PER_US (CPU_HZ / 1000000u)
#define CYCLES (CYCLES_PER_US << US_SHIFT)
#define CYCLES_MAX (1u << 24) /* SysTick has 24 bits */

static volatile uint32_t wraps;

void systick_handler(void);
/* Handle the interrupt of the timer SysTick: count the periods of the timer. */
void systick_handler(void)
{
    wraps++;
}

/* Start the timer SysTick, from which the clock of the program is computed. */
void ticks_init(void)
{
    SYSTICK->reload = CYCLES - 1u;
    SYSTICK->value = 0; /* any write sets the value to 0; the next cycle loads `reload` */
    SYSTICK->control = SYSTICK_CONTROL_ENABLE | SYSTICK_CONTROL_INTERRUPT | SYSTICK_CONTROL_PROCESSOR_CLOCK;
}

#ifdef IMAGE_APPLICATION

_Static_assert(CPU_HZ == 48000000u, "a microsecond is 16 * 3 cycles");
_Static_assert(CYCLES <= CYCLES_MAX, "a wrap can be that long");

/* Compute x / 3, rounded down, without a division, which this processor lacks: 1/3 = 1/4 + 1/16 + ... The shifts leave
 * a remainder x - 3 * third below 32, which the last line divides by 3 as 11 / 32 (checked for every x below 2^20, more
 * than one period of the timer). */
static uint32_t third_of(uint32_t x)
{
    uint32_t third = (x >> 2) + (x >> 4);
    third += third >> 4;
    third += third >> 8;
    third += third >> 16;
    return third + (((x - 3u * third) * 11u) >> 5);
}

/* Read the timer SysTick: `whole` receives the number of whole periods since ticks_init(). Returns the microseconds
 * since the start of the present period. */
static uint32_t read(uint32_t *whole)
{
    uint32_t count, value;
    do {
        count = wraps;
        value = SYSTICK->value;
        *whole = count;
        /* wrapped, but not counted yet: the value may be from before the wrap */
        if (SCS_ICSR & SCS_ICSR_SYSTICK_PENDING) {
            value = SYSTICK->value;
            *whole = count + 1u;
        }
    } while (count != wraps);
    /* the interrupt is pending from the cycle in which the value is 0 */
    const uint32_t since = value ? CYCLES - value : 0;
    return third_of(since >> 4); /* 16 * 3 cycles are 1 us */
}

/* Return the time since ticks_init() in microseconds, 64 bits. A period of the timer is 2^US_SHIFT microseconds. */
uint64_t ticks_us(void)
{
    uint32_t whole;
    const uint32_t part = read(&whole);
    return ((uint64_t)whole << US_SHIFT) | part;
}

/* Return the time since ticks_init() in microseconds, modulo 2^32. */
uint32_t ticks_us_32(void)
{
    return (uint32_t)ticks_us();
}

/* Return the number of whole periods of the timer SysTick since ticks_init(), of about 4 ms each. */
uint32_t ticks_periods(void)
{
    return wraps;
}

/* Return whether the timer SysTick interrupts before the time `us` (microseconds since ticks_init()), so that a sleep
 * ends in time: `us` is in a later period of the timer, which is 2^US_SHIFT microseconds long. */
bool ticks_interrupts_before(uint64_t us)
{
    return us >> US_SHIFT > ticks_us() >> US_SHIFT;
}

/* Set SysTick to its longest period, because its interrupt cannot count periods during a flash write. Returns the
 * microseconds since the last counted wrap, to be passed to ticks_shrink(). */
uint32_t ticks_stretch(void)
{
    uint32_t whole;
    const uint32_t part = read(&whole);
    wraps = whole;
    SYSTICK->reload = CYCLES_MAX - 1u;
    SYSTICK->value = 0;
    SCS_ICSR = SCS_ICSR_SYSTICK_CLEAR; /* this wrap is included above */
    return part;
}

/* Return SysTick to its normal period and add the elapsed microseconds to the clock. `begin`: result of
 * ticks_stretch(). */
void ticks_shrink(uint32_t begin)
{
    const uint32_t us = begin + third_of((CYCLES_MAX - SYSTICK->value) >> 4);
    const uint32_t part = us & ((1u << US_SHIFT) - 1u);
    wraps += us >> US_SHIFT;
    /* the first period is only the rest of the interrupted period; the second value of `reload` is for all others */
    SYSTICK->reload = CYCLES - CYCLES_PER_US * part - 1u;
    SYSTICK->value = 0;
    SCS_ICSR = SCS_ICSR_SYSTICK_CLEAR;
    SYSTICK->reload = CYCLES - 1u;
}

/* Wait for at least this number of microseconds. */
void ticks_delay_us(uint32_t microseconds)
{
    const uint32_t begin = ticks_us_32();
    while (ticks_us_32() - begin <= microseconds) {
    }
}

#else

/* Return the time since ticks_init() in microseconds, modulo 2^32, in steps of one period of the timer: sufficient for
 * a bootloader. */
uint32_t ticks_us_32(void)
{
    return wraps << US_SHIFT;
}

#endif
