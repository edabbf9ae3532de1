/* The port's clock on SysTick: it never runs backwards, with interrupts on or off, ticks come when they are due, and a wait ends
 * with one. Every figure is a count of what went wrong, or of ticks. */
#include "boards/psoc4200/ticks.h"
#include "boards/psoc4200/clocks.h"
#include "boards/psoc4200/regs/core.h"
#include "image.h"

#define CYCLES_PER_US (CPU_HZ / 1000000u)
#define WRAP_US 4096u
#define LATE_MAX 100u /* cycles from the end of a period to the handler's first look */
#define JUMP_MAX 12u  /* us from one reading to the next */
#define RUN 100000u

void systick_handler(void);

static volatile uint32_t ticks, latest, work;

void on_systick(void)
{
    const uint32_t late = SYSTICK->reload - SYSTICK->value;
    latest = late > latest ? late : latest;
    ticks++;
    systick_handler();
}

/* Readings in a row, from 3 ms after a tick to behind the next: how many are less than the one before, or far from it. */
static void read_on(const char *name, bool masked)
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
        put_word("  ticks then", ticks - before);
    }
}

static void work_on(uint32_t rounds)
{
    for (uint32_t i = 0; i < rounds; i++) {
        work += i;
    }
}

static uint32_t timed(uint32_t rounds)
{
    const uint64_t begin = ticks_us();
    work_on(rounds);
    return (uint32_t)(ticks_us() - begin);
}

/* Work of several wraps in the time that a long wrap is given for it: the clock shows what it shows otherwise. */
static void stretched(void)
{
    const uint32_t plain = timed(RUN), interrupts = interrupts_mask();
    const uint64_t begin = ticks_us();
    const uint32_t part = ticks_stretch();
    work_on(RUN);
    ticks_shrink(part);
    interrupts_unmask(interrupts);
    const uint32_t found = (uint32_t)(ticks_us() - begin), apart = found > plain ? found - plain : plain - found;
    put_word("wraps in that work", plain > 2u * WRAP_US);
    put_word("time lost in a long wrap", apart * 100u > plain);
}

static void waits(void)
{
    uint32_t wrong = 0;
    for (unsigned i = 0; i < 8u; i++) {
        const uint32_t before = ticks;
        wait_for_interrupt();
        wrong += ticks != before + 1u;
    }
    put_word("waits that did not end with a tick", wrong);
}

static void delays(void)
{
    uint32_t wrong = 0;
    for (uint32_t us = 10; us < 20000u; us *= 3u) {
        const uint64_t begin = ticks_us();
        ticks_delay_us(us);
        const uint64_t took = ticks_us() - begin;
        wrong += took < us || took > us + JUMP_MAX;
    }
    put_word("delays too short or long", wrong);
}

static void masked_ticks(void)
{
    const uint32_t interrupts = interrupts_mask(), before = ticks;
    work_on(RUN);
    put_word("ticks while masked", ticks - before);
    put_word("  pending", !!(SCS_ICSR & SCS_ICSR_SYSTICK_PENDING));
    interrupts_unmask(interrupts);
    __asm__ volatile("isb" ::: "memory");
    put_word("  kept", ticks - before);
}

int main(void)
{
    ticks_init();
    read_on("interrupts on:", false);
    read_on("interrupts off:", true);
    delays();
    latest = 0;
    waits();
    work_on(RUN);
    put_word("late", latest > LATE_MAX);
    masked_ticks();
    stretched();
    return 0;
}
