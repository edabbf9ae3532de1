/* Random programs from seeds: no access leaves its memory (checked by the sanitizers), and dividing a run into several
 * runs does not change its result. `test_cortex_m0_random FIRST COUNT` runs other seeds than the first 400. */
#include <stdlib.h>

#include "check.h"
#include "emulator/base/random.h"
#include "test_cortex_m0_bench.h"

#define DEFAULT_SEED_COUNT 400u
#define CYCLES 4000u
#define STEPS 600u
#define LOOP_END 66u /* 2 plus a multiple of 4 */
#define FIRST_32_BIT 0xE800u
#define SYSTICK_PERIOD 97u

static struct bench whole, divided;
static struct cortex_m0_account whole_account, divided_account;
static uint64_t first_seed, seed_count = DEFAULT_SEED_COUNT;

/* Return a random 16-bit instruction; most of those that would only fault are replaced. */
static uint16_t random_half(struct random_source *random)
{
    const uint16_t half = (uint16_t)random_u64(random);
    /* replace most instructions that only fault */
    if (half >= FIRST_32_BIT || half >> 8 == 0xDEu || half >> 8 == 0xBEu) {
        static const uint16_t instead[] = {0xBF30, 0xB672, 0xB662, 0xDF00, 0xB5F0,
                                           0xBDF0, 0xC8F0, 0x4770, 0xF000, 0xBF20};
        return instead[half % (sizeof instead / sizeof *instead)];
    }
    return half;
}

/* Write a random program to a test processor: handlers return (the fault handler skips the faulting instruction),
 * registers hold addresses, SysTick and interrupts are active. */
static void prepare_program(struct bench *bench, uint64_t seed)
{
    struct random_source random;
    random_init(&random, seed, 0);
    bench_init(bench);
    for (uint32_t at = BENCH_HANDLER(CORTEX_M0_EXCEPTIONS); at < BENCH_FLASH; at += 2) {
        bench_put(bench, at, &(const uint16_t){random_half(&random)}, 1);
    }
    for (uint32_t at = BENCH_MAIN; at < BENCH_HANDLER(0); at += 2) {
        bench_put(bench, at, &(const uint16_t){random_half(&random)}, 1);
    }
    BENCH_PUT(bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT), 0x9806, 0x3002, 0x9006, 0x4770);
    bench_reset(bench);
    struct cortex_m0 *const cpu = &bench->cpu;
    for (unsigned i = 0; i < 13; i++) {
        const uint32_t random_value = (uint32_t)random_u64(&random);
        const uint32_t candidates[] = {BENCH_RAM_BASE + random_value % BENCH_RAM, BENCH_PORT + random_value % 32u,
                                       random_value % 256u, BENCH_RAM_BASE + random_value % BENCH_RAM / 4u * 4u};
        cpu->r[i] = candidates[random_u64(&random) % 4u];
    }
    cpu->r[13] = BENCH_STACK - 256u;
    cpu->r[14] = BENCH_MAIN | 1u;
    cpu->enabled = ~UINT64_C(0);
    cpu->level[0] = 0x1111111111111111u << seed % 4u;
    cpu->level[seed % 4u] = ~cpu->level[0];
    cpu->systick = (struct cortex_m0_systick){
        .reload = SYSTICK_PERIOD, .enabled = true, .interrupt_enabled = true, .processor_clock = true, .origin = 0};
    bench->raises = seed % 3u == 0 ? (int)(seed % 32u) : -1;
    bench->stall = (uint32_t)(seed % 5u);
}

/* Check that two processors, one run at once and one run in parts, have the same state. */
static void check_same(void)
{
    const struct cortex_m0 *const a = &whole.cpu, *const b = &divided.cpu;
    CHECK_BYTES(a->r, b->r, sizeof a->r);
    CHECK_EQUAL(cortex_m0_xpsr(a), cortex_m0_xpsr(b));
    CHECK_EQUAL(a->cycle, b->cycle);
    CHECK_EQUAL(a->progress, b->progress);
    CHECK_EQUAL(a->pending, b->pending);
    CHECK_EQUAL(a->active, b->active);
    CHECK_EQUAL(a->faults, b->faults);
    CHECK_EQUAL(a->sleep_cycles, b->sleep_cycles);
    CHECK_EQUAL(a->other_sp, b->other_sp);
    CHECK_EQUAL(a->lowest_sp, b->lowest_sp);
    CHECK_EQUAL(whole.count, divided.count);
    CHECK_BYTES(whole.ram, divided.ram, sizeof whole.ram);
    CHECK_BYTES(&whole_account, &divided_account, sizeof whole_account);
}

/* Run the processor to a cycle, also while it is locked up: the first run reports a lockup at once; the second run
 * advances the time. */
static void run_to(struct cortex_m0 *cpu, uint64_t until)
{
    if (cortex_m0_run(cpu, until) == CORTEX_M0_LOCKUP) {
        cortex_m0_run(cpu, until);
    }
    CHECK(cpu->cycle >= until);
}

static void dividing_a_random_run_does_not_change_the_result(void)
{
    for (uint64_t seed = first_seed; seed < first_seed + seed_count; seed++) {
        struct random_source random;
        random_init(&random, seed, 1);
        prepare_program(&whole, seed);
        prepare_program(&divided, seed);
        memset(&whole_account, 0, sizeof whole_account);
        memset(&divided_account, 0, sizeof divided_account);
        cortex_m0_set_account(&whole.cpu, &whole_account);
        cortex_m0_set_account(&divided.cpu, &divided_account);
        const unsigned failures = check_state.failures;
        for (uint64_t until = 0; until < CYCLES;) {
            const uint64_t longest = random_u64(&random) % 60u + 1u;
            until += random_u64(&random) % longest + 1u;
            until = until < CYCLES ? until : CYCLES;
            run_to(&divided.cpu, until);
            CHECK_EQUAL(divided.cpu.r[13] & 3u, 0);
        }
        run_to(&whole.cpu, CYCLES);
        check_same();
        if (check_state.failures > failures) {
            printf("  replay: test_cortex_m0_random %llu 1\n", (unsigned long long)seed);
            return;
        }
    }
}

/* Return a random instruction; every third is a store (STR, STRB, STRH, STM, PUSH) near an address in a register, the
 * others are no branches. */
static uint16_t random_storing_half(struct random_source *random)
{
    static const uint16_t stores[] = {0x6000, 0x7000, 0x8000, 0xC000, 0xB400};
    const uint16_t half = random_half(random);
    if (random_u64(random) % 3u) {
        return half >> 12 == 0xDu || half >> 12 == 0xEu ? 0x3001u : half; /* no branches, so that the loop proceeds */
    }
    return (uint16_t)(stores[random_u64(random) % 5u] | (half & 0x01BFu) | 1u);
}

/* Write a random loop to RAM, from byte 2 on, with occasional calls of the following instruction. The registers hold
 * addresses within the loop. */
static void put_loop(struct bench *bench, struct random_source *random)
{
    struct cortex_m0 *const cpu = &bench->cpu;
    for (uint32_t at = 2; at < LOOP_END; at += 4) {
        const bool call = random_u64(random) % 8u == 0;
        BENCH_PUT(bench, BENCH_RAM_BASE + at, call ? 0xF000u : random_storing_half(random),
                  call ? 0xF800u : random_storing_half(random));
    }
    /* B to 2 */
    BENCH_PUT(bench, BENCH_RAM_BASE + LOOP_END, (uint16_t)(0xE000u | ((0u - (LOOP_END + 2u) / 2u) & 0x7FFu)));
    for (unsigned r = 0; r < 8; r++) {
        cpu->r[r] = BENCH_RAM_BASE + (uint32_t)(random_u64(random) % (LOOP_END / 4u)) * 4u;
    }
    cpu->r[13] = BENCH_RAM_BASE + BENCH_RAM / 2u;
    cpu->r[15] = BENCH_RAM_BASE + 2u;
}

/* Self-modifying code in RAM gives the same result whether it is decoded incrementally or again before each
 * instruction. */
static void self_modifying_code_is_never_executed_stale(void)
{
    uint64_t changes = 0;
    for (uint64_t seed = first_seed; seed < first_seed + seed_count; seed++) {
        for (unsigned i = 0; i < 2; i++) {
            struct bench *const bench = i ? &divided : &whole;
            struct random_source random;
            random_init(&random, seed, 3);
            prepare_program(bench, seed);
            put_loop(bench, &random);
        }
        uint8_t before[BENCH_RAM];
        memcpy(before, whole.ram, sizeof before);
        for (unsigned i = 0; i < STEPS; i++) {
            cortex_m0_step(&whole.cpu);
            cortex_m0_memory_changed(&divided.cpu, BENCH_RAM_BASE, LOOP_END + 4u);
            cortex_m0_step(&divided.cpu);
        }
        changes += memcmp(before, whole.ram, BENCH_RAM / 2u) != 0;
        const bool same = CHECK_BYTES(whole.cpu.r, divided.cpu.r, sizeof whole.cpu.r);
        if (!same || !CHECK_BYTES(whole.ram, divided.ram, sizeof whole.ram)) {
            printf("  replay: test_cortex_m0_random %llu 1\n", (unsigned long long)seed);
            return;
        }
    }
    printf("%llu of %llu programs modified themselves\n", (unsigned long long)changes, (unsigned long long)seed_count);
    CHECK(changes * 2u > seed_count);
}

static void random_programs_stay_within_their_memory(void)
{
    uint64_t faults = 0, exceptions = 0, accesses = 0, lockups = 0;
    for (uint64_t seed = first_seed; seed < first_seed + seed_count; seed++) {
        struct random_source random;
        random_init(&random, seed, 2);
        prepare_program(&whole, seed);
        cortex_m0_set_account(&whole.cpu, &whole_account);
        for (uint64_t until = 0; until < CYCLES; until += random_u64(&random) % 50u) {
            whole.status = random_u64(&random) % 8u ? CORTEX_M0_OK : CORTEX_M0_RETRY;
            whole.stops = random_u64(&random) % 4u == 0;
            const unsigned irq = (unsigned)(random_u64(&random) % 32u), action = (unsigned)(random_u64(&random) % 16u);
            if (action < 2) {
                cortex_m0_set_line(&whole.cpu, irq, true);
            } else if (action == 2) {
                cortex_m0_pulse_nmi(&whole.cpu);
            }
            cortex_m0_run(&whole.cpu, until);
            for (unsigned i = 0; i < CORTEX_M0_IRQS; i++) {
                cortex_m0_set_line(&whole.cpu, i, false);
            }
        }
        faults += whole.cpu.faults;
        accesses += whole.count;
        lockups += whole.cpu.locked_up;
        for (unsigned i = 0; i < CORTEX_M0_EXCEPTIONS; i++) {
            exceptions += whole_account.cost[i].count;
        }
    }
    printf("seeds %llu to %llu: %llu faults, %llu handlers, %llu accesses, %llu lockups\n",
           (unsigned long long)first_seed, (unsigned long long)(first_seed + seed_count - 1u),
           (unsigned long long)faults, (unsigned long long)exceptions, (unsigned long long)accesses,
           (unsigned long long)lockups);
    CHECK(faults > seed_count && exceptions > seed_count && accesses > seed_count / 2u && lockups < seed_count);
}

/* Run random programs (arguments: first seed, number of seeds). Exit status 1 after a failure. */
int main(int count, char **arguments)
{
    if (count == 3) {
        first_seed = strtoull(arguments[1], NULL, 10);
        seed_count = strtoull(arguments[2], NULL, 10);
    }
    RUN(dividing_a_random_run_does_not_change_the_result);
    RUN(self_modifying_code_is_never_executed_stale);
    RUN(random_programs_stay_within_their_memory);
    cortex_m0_free(&whole.cpu);
    cortex_m0_free(&divided.cpu);
    return check_summary();
}
