/* Clock of the PSoC 4200 port on SysTick: it never runs backwards, with interrupts enabled or disabled; ticks occur
 * when due; a wait ends with a tick. Every printed figure is a count of errors or of ticks. */
#include "boards/psoc4/ticks.h"
#include "boards/psoc4/clocks.h"
#include "boards/psoc4/regs/core.h"
#include "image.h"

#define CYCLES_PER_US (CPU_HZ / 1000000u)
#define WRAP_US 4096u
#define DELAY_MAX 100u /* cycles from the end of a period to the first read in the handler */
#define JUMP_MAX 12u   /* us between two consecutive readings */
#define RUN 100000u

void systick_handler(void);

static volatile uint32_t ticks, delay_max, work;

/* SysTick handler: measure the delay (cycles) since the end of the period, then run the handler of the firmware. */
void on_systick(void)
{
    const uint32_t delay = SYSTICK->reload - SYSTICK->value;
    delay_max = delay > delay_max ? delay : delay_max;
    ticks++;
    systick_handler();
}

/* Count the readings of the clock that decrease or jump, with interrupts enabled or masked. The clock is read
 * continuously from about 3 ms after a tick until after the next tick; the period of the ticks is WRAP_US. */
static void check_monotonic(const char *name, bool masked)
{
    uint32_t backwards = 0, jumps = 0;
    wait_for_interrupt();
    ticks_delay_us(WRAP_US * 3u / 4u);
    const uint32_t before = ticks, interrupts = masked ? interrupts_mask() : 0;
    const uint64_t begin = ticks_us();
    for (uint64_t last = begin, now = begin; now - begin < WRAP_US / 2u; last = now) {
        now = ticks_us();
        backwards += now < last;
        jumps += now > last + JUMP_MAX;
    }
    put_text(name);
    put_word(" backwards", backwards);
    put_word("  jumps", jumps);
    put_word("  ticks", ticks - before);
    if (masked) {
        interrupts_unmask(interrupts);
        __asm__ volatile("isb" ::: "memory");
        put_word("  ticks after unmasking", ticks - before);
    }
}

/* Keep the processor busy for a time that is proportional to `iterations`. */
static void busy_loop(uint32_t iterations)
{
    for (uint32_t i = 0; i < iterations; i++) {
        work += i;
    }
}

/* Return the duration of a busy loop in microseconds, measured with the clock under test. */
static uint32_t time_busy_loop(uint32_t iterations)
{
    const uint64_t begin = ticks_us();
    busy_loop(iterations);
    return (uint32_t)(ticks_us() - begin);
}

/* Check that the clock loses no time between ticks_stretch() and ticks_shrink(), while interrupts are off for several
 * wraps of the counter: the measured duration of a busy loop is the same as with interrupts on, within 1 %. */
static void check_stretched_wrap(void)
{
    const uint32_t normal_us = time_busy_loop(RUN), interrupts = interrupts_mask();
    const uint64_t begin = ticks_us();
    const uint32_t part = ticks_stretch();
    busy_loop(RUN);
    ticks_shrink(part);
    interrupts_unmask(interrupts);
    const uint32_t stretched_us = (uint32_t)(ticks_us() - begin);
    const uint32_t difference = stretched_us > normal_us ? stretched_us - normal_us : normal_us - stretched_us;
    put_word("busy loop longer than two wraps", normal_us > 2u * WRAP_US);
    put_word("time lost in a long wrap", difference * 100u > normal_us);
}

/* Count waits for an interrupt that do not end with exactly one tick. */
static void check_waits(void)
{
    uint32_t errors = 0;
    for (unsigned i = 0; i < 8u; i++) {
        const uint32_t before = ticks;
        wait_for_interrupt();
        errors += ticks != before + 1u;
    }
    put_word("waits that did not end with a tick", errors);
}

/* Count delays from 10 us to 20 ms that are shorter than requested, or longer by more than the maximum difference of
 * two readings. */
static void check_delays(void)
{
    uint32_t errors = 0;
    for (uint32_t us = 10; us < 20000u; us *= 3u) {
        const uint64_t begin = ticks_us();
        ticks_delay_us(us);
        const uint64_t elapsed = ticks_us() - begin;
        errors += elapsed < us || elapsed > us + JUMP_MAX;
    }
    put_word("delays too short or long", errors);
}

/* Keep interrupts disabled for longer than a period: no tick may be handled, one must be pending, and it must be
 * handled after unmasking. */
static void check_masked_ticks(void)
{
    const uint32_t interrupts = interrupts_mask(), before = ticks;
    busy_loop(RUN);
    put_word("ticks while masked", ticks - before);
    put_word("  pending", !!(SCS_ICSR & SCS_ICSR_SYSTICK_PENDING));
    interrupts_unmask(interrupts);
    __asm__ volatile("isb" ::: "memory");
    put_word("  served after unmasking", ticks - before);
}

/* Run all checks of the clock and print their error counts. */
int main(void)
{
    ticks_init();
    check_monotonic("interrupts on:", false);
    check_monotonic("interrupts off:", true);
    check_delays();
    delay_max = 0;
    check_waits();
    busy_loop(RUN);
    put_word("late", delay_max > DELAY_MAX);
    check_masked_ticks();
    check_stretched_wrap();
    return 0;
}
