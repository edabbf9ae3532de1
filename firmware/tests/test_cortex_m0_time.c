/* Cycle-exact SysTick, and sleep. */
#include "check.h"
#include "test_cortex_m0_bench.h"

#define CSR 0xE000E010u
#define RVR 0xE000E014u
#define CVR 0xE000E018u
#define CALIB 0xE000E01Cu
#define SCR 0xE000ED10u

#define NOP 0xBF00u
#define WFI 0xBF30u
#define WFE 0xBF20u
#define SEV 0xBF40u

static struct bench bench;
static struct cortex_m0 *const cpu = &bench.cpu;

/* The store that enables SysTick has its data phase in cycle 2; the counter is loaded one cycle later. */
static void systick_counts_processor_cycles(void)
{
    bench_nops(&bench);
    bench_store(&bench, RVR, 99);
    bench_store(&bench, CVR, 0);
    const uint64_t enabled = cpu->cycle + 1u;
    bench_store(&bench, CSR, 5);
    uint32_t value = bench_load(&bench, CVR);
    CHECK_EQUAL(value, 99 - (cpu->cycle - 1u - (enabled + 1u)));
    CHECK_EQUAL(bench_load(&bench, CVR), value - 2u);
    CHECK_EQUAL(bench_load(&bench, CSR), 5);
    cortex_m0_run(cpu, enabled + 101u);
    CHECK_EQUAL(bench_load(&bench, CSR), 0x10005u);
    CHECK_EQUAL(bench_load(&bench, CSR), 5); /* the previous read cleared the flag */
    cpu->cycle = enabled + 100u * 1000000u + 49u;
    CHECK_EQUAL(bench_load(&bench, CVR), 50);
    bench_store(&bench, CVR, 7);
    CHECK_EQUAL(bench_load(&bench, CSR), 5);
}

static void systick_interrupts_in_its_cycle_and_every_period_after(void)
{
    bench_nops(&bench);
    bench_store(&bench, RVR, 999);
    BENCH_PUT(&bench, BENCH_HANDLER(CORTEX_M0_SYSTICK), 0x3601, 0x4770); /* ADDS r6, #1; BX LR */
    BENCH_PUT(&bench, BENCH_MAIN, NOP, 0xE7FD);
    cpu->r[15] = BENCH_MAIN;
    const uint64_t enabled = cpu->cycle + 1u;
    bench_store(&bench, CSR, 7);
    struct cortex_m0_account account;
    cortex_m0_set_account(cpu, &account);
    cortex_m0_run(cpu, enabled + 1000u * 1000u + 500u);
    CHECK_EQUAL(cpu->r[6], 1000);
    CHECK_EQUAL(account.cost[CORTEX_M0_SYSTICK].count, 1000);
    CHECK_EQUAL(account.cost[CORTEX_M0_SYSTICK].exclusive_min, 16 + 1 + 3 + 12);
    CHECK_EQUAL(account.cost[CORTEX_M0_SYSTICK].exclusive_max, 16 + 1 + 3 + 12);
    CHECK_BETWEEN(account.cost[CORTEX_M0_SYSTICK].latency_max, 1, 2); /* the branch is completed */
}

static void systick_counts_the_reference_clock(void)
{
    bench_nops(&bench);
    bench.config.systick_reference = 1500; /* 32 kHz at 48 MHz */
    bench.config.systick_calibration = 0x147;
    bench_reset(&bench);
    CHECK_EQUAL(bench_load(&bench, CALIB), 0x147);
    bench_store(&bench, RVR, 9);
    bench_store(&bench, CSR, 1);
    CHECK_EQUAL(bench_load(&bench, CSR), 1);
    cpu->cycle += 1500u * 4u;
    CHECK_EQUAL(bench_load(&bench, CVR), 6); /* loaded by the first tick */
}

static void systick_without_reload_stops_at_zero(void)
{
    bench_nops(&bench);
    bench_store(&bench, RVR, 20);
    bench_store(&bench, CSR, 5);
    bench_load(&bench, CVR);
    bench_store(&bench, RVR, 0);
    cortex_m0_run(cpu, cpu->cycle + 30u);
    CHECK_EQUAL(bench_load(&bench, CVR), 0);
    CHECK_EQUAL(bench_load(&bench, CSR), 0x10005u);
    cortex_m0_run(cpu, cpu->cycle + 30u);
    CHECK_EQUAL(bench_load(&bench, CSR), 5);
}

static void sleep_of_wfi_lasts_until_an_enabled_interrupt(void)
{
    bench_nops(&bench);
    cpu->enabled |= UINT64_C(1) << 16;
    BENCH_PUT(&bench, BENCH_MAIN, WFI, NOP);
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_ASLEEP);
    CHECK_EQUAL(cpu->cycle, 1000);
    CHECK_EQUAL(cpu->asleep_since, 2);
    CHECK_EQUAL(cortex_m0_wake_cycle(cpu), UINT64_MAX);
    cortex_m0_set_line(cpu, 1, true); /* not enabled */
    CHECK_EQUAL(cortex_m0_run(cpu, 2000), CORTEX_M0_ASLEEP);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, 16);
    CHECK_EQUAL(cpu->cycle, 2016);
    CHECK_EQUAL(cpu->sleep_cycles, 1998);
}

static void a_masked_interrupt_ends_sleep_and_stays_pending(void)
{
    bench_nops(&bench);
    cpu->enabled |= UINT64_C(1) << 16;
    BENCH_PUT(&bench, BENCH_MAIN, 0xB672, WFI, NOP);
    cortex_m0_run(cpu, 100);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, 0);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 6u);
    CHECK_EQUAL(cpu->pending, UINT64_C(1) << 16);
}

static void systick_ends_sleep_in_its_cycle(void)
{
    bench_nops(&bench);
    bench_store(&bench, RVR, 9999);
    const uint64_t enabled = cpu->cycle + 1u;
    bench_store(&bench, CSR, 7);
    BENCH_PUT(&bench, BENCH_MAIN, WFI, 0xE7FD);
    cpu->r[15] = BENCH_MAIN;
    cortex_m0_run(cpu, enabled + 5000u);
    CHECK_EQUAL(cortex_m0_wake_cycle(cpu), enabled + 10000u);
    struct cortex_m0_account account;
    cortex_m0_set_account(cpu, &account);
    CHECK_EQUAL(cortex_m0_run(cpu, enabled + 10000u * 100u + 500u), CORTEX_M0_ASLEEP);
    CHECK_EQUAL(account.cost[CORTEX_M0_SYSTICK].count, 100);
    CHECK_EQUAL(account.cost[CORTEX_M0_SYSTICK].latency_max, 0);
}

static void deep_sleep_stops_systick(void)
{
    bench_nops(&bench);
    bench_store(&bench, RVR, 9999);
    bench_store(&bench, SCR, 4);
    bench_store(&bench, CSR, 7);
    BENCH_PUT(&bench, BENCH_MAIN, WFI, 0xE7FD);
    cpu->r[15] = BENCH_MAIN;
    CHECK_EQUAL(cortex_m0_run(cpu, 1000000), CORTEX_M0_ASLEEP);
    CHECK_EQUAL(cpu->pending, 0);
    CHECK(cpu->systick.value > 9900);
}

static void an_event_ends_the_sleep_of_wfe(void)
{
    bench_nops(&bench);
    BENCH_PUT(&bench, BENCH_MAIN, SEV, WFE, WFE, NOP);
    CHECK_EQUAL(cortex_m0_run(cpu, 100), CORTEX_M0_ASLEEP);
    CHECK_EQUAL(cpu->asleep_since, 1 + 2 + 2);
    cortex_m0_send_event(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 8u);
    CHECK_EQUAL(cpu->cycle, 101);
}

static void a_pending_interrupt_is_an_event_if_sevonpend_is_set(void)
{
    for (unsigned sevonpend = 0; sevonpend < 2; sevonpend++) {
        bench_nops(&bench);
        bench_store(&bench, SCR, sevonpend ? 16 : 0);
        BENCH_PUT(&bench, BENCH_MAIN, WFE, NOP);
        cpu->r[15] = BENCH_MAIN;
        cortex_m0_run(cpu, 100);
        cortex_m0_pulse(cpu, 9); /* not enabled */
        cortex_m0_run(cpu, 101);
        CHECK_EQUAL(cpu->asleep, !sevonpend);
    }
}

/* The main program never executes an instruction: the program counter stays at its first one. */
static void with_sleep_on_exit_the_processor_sleeps_between_handlers(void)
{
    bench_nops(&bench);
    bench_store(&bench, SCR, 2);
    cpu->enabled |= UINT64_C(1) << 16;
    cpu->r[15] = BENCH_MAIN;
    cortex_m0_pulse(cpu, 0);
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_ASLEEP);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN);
    cortex_m0_pulse(cpu, 0);
    CHECK_EQUAL(cortex_m0_run(cpu, 2000), CORTEX_M0_ASLEEP);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN);
}

int main(void)
{
    RUN(systick_counts_processor_cycles);
    RUN(systick_interrupts_in_its_cycle_and_every_period_after);
    RUN(systick_counts_the_reference_clock);
    RUN(systick_without_reload_stops_at_zero);
    RUN(sleep_of_wfi_lasts_until_an_enabled_interrupt);
    RUN(a_masked_interrupt_ends_sleep_and_stays_pending);
    RUN(systick_ends_sleep_in_its_cycle);
    RUN(deep_sleep_stops_systick);
    RUN(an_event_ends_the_sleep_of_wfe);
    RUN(a_pending_interrupt_is_an_event_if_sevonpend_is_set);
    RUN(with_sleep_on_exit_the_processor_sleeps_between_handlers);
    cortex_m0_free(cpu);
    return check_summary();
}
