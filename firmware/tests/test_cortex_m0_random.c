/* Random programs, with a seed: nothing leaves its memory (sanitizers watch), and however a run is cut up, it is the same.
 * `test_cortex_m0_random FIRST COUNT` for other seeds than the first 400. */
#include <stdlib.h>

#include "check.h"
#include "emulator/random.h"
#include "test_cortex_m0_bench.h"

#define TRIALS 400u
#define CYCLES 4000u
#define STEPS 600u
#define LOOP_END 66u /* 2, and a multiple of 4 */
#define WIDE 0xE800u
#define SYSTICK_PERIOD 97u

static struct bench whole, cut;
static struct cortex_m0_account whole_account, cut_account;
static uint64_t first_seed, seeds = TRIALS;

static uint16_t draw_half(struct random_source *random)
{
    const uint16_t half = (uint16_t)random_u64(random);
    if (half >= WIDE || half >> 8 == 0xDEu || half >> 8 == 0xBEu) { /* few of those that only fault */
        static const uint16_t instead[] = {0xBF30, 0xB672, 0xB662, 0xDF00, 0xB5F0, 0xBDF0, 0xC8F0, 0x4770, 0xF000, 0xBF20};
        return instead[half % (sizeof instead / sizeof *instead)];
    }
    return half;
}

/* Handlers that come back, a fault's behind its instruction; registers that are addresses; SysTick and interrupts. */
static void make(struct bench *bench, uint64_t seed)
{
    struct random_source random;
    random_init(&random, seed, 0);
    bench_init(bench);
    for (uint32_t at = BENCH_HANDLER(CORTEX_M0_EXCEPTIONS); at < BENCH_FLASH; at += 2) {
        bench_put(bench, at, &(const uint16_t){draw_half(&random)}, 1);
    }
    for (uint32_t at = BENCH_MAIN; at < BENCH_HANDLER(0); at += 2) {
        bench_put(bench, at, &(const uint16_t){draw_half(&random)}, 1);
    }
    BENCH_PUT(bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT), 0x9806, 0x3002, 0x9006, 0x4770);
    bench_reset(bench);
    struct cortex_m0 *const cpu = &bench->cpu;
    for (unsigned i = 0; i < 13; i++) {
        const uint32_t drawn = (uint32_t)random_u64(&random);
        const uint32_t places[] = {BENCH_RAM_BASE + drawn % BENCH_RAM, BENCH_PORT + drawn % 32u, drawn % 256u,
                                   BENCH_RAM_BASE + drawn % BENCH_RAM / 4u * 4u};
        cpu->r[i] = places[random_u64(&random) % 4u];
    }
    cpu->r[13] = BENCH_STACK - 256u;
    cpu->r[14] = BENCH_MAIN | 1u;
    cpu->enabled = ~UINT64_C(0);
    cpu->level[0] = 0x1111111111111111u << seed % 4u;
    cpu->level[seed % 4u] = ~cpu->level[0];
    cpu->systick = (struct cortex_m0_systick){
        .reload = SYSTICK_PERIOD, .enabled = true, .interrupts = true, .processor_clock = true, .origin = 0};
    bench->raises = seed % 3u == 0 ? (int)(seed % 32u) : -1;
    bench->stall = (uint32_t)(seed % 5u);
}

static void check_same(void)
{
    const struct cortex_m0 *const a = &whole.cpu, *const b = &cut.cpu;
    CHECK_BYTES(a->r, b->r, sizeof a->r);
    CHECK_EQUAL(cortex_m0_xpsr(a), cortex_m0_xpsr(b));
    CHECK_EQUAL(a->cycle, b->cycle);
    CHECK_EQUAL(a->progress, b->progress);
    CHECK_EQUAL(a->pending, b->pending);
    CHECK_EQUAL(a->active, b->active);
    CHECK_EQUAL(a->faults, b->faults);
    CHECK_EQUAL(a->slept, b->slept);
    CHECK_EQUAL(a->other_sp, b->other_sp);
    CHECK_EQUAL(a->lowest_sp, b->lowest_sp);
    CHECK_EQUAL(whole.count, cut.count);
    CHECK_BYTES(whole.ram, cut.ram, sizeof whole.ram);
    CHECK_BYTES(&whole_account, &cut_account, sizeof whole_account);
}

/* A lockup is told at once; then time passes. */
static void run_to(struct cortex_m0 *cpu, uint64_t until)
{
    if (cortex_m0_run(cpu, until) == CORTEX_M0_LOCKUP) {
        cortex_m0_run(cpu, until);
    }
    CHECK(cpu->cycle >= until);
}

static void however_a_run_is_cut_up_it_is_the_same(void)
{
    for (uint64_t seed = first_seed; seed < first_seed + seeds; seed++) {
        struct random_source random;
        random_init(&random, seed, 1);
        make(&whole, seed);
        make(&cut, seed);
        memset(&whole_account, 0, sizeof whole_account);
        memset(&cut_account, 0, sizeof cut_account);
        cortex_m0_set_account(&whole.cpu, &whole_account);
        cortex_m0_set_account(&cut.cpu, &cut_account);
        const unsigned failures = check_state.failures;
        for (uint64_t until = 0; until < CYCLES;) {
            const uint64_t longest = random_u64(&random) % 60u + 1u;
            until += random_u64(&random) % longest + 1u;
            until = until < CYCLES ? until : CYCLES;
            run_to(&cut.cpu, until);
            CHECK_EQUAL(cut.cpu.r[13] & 3u, 0);
        }
        run_to(&whole.cpu, CYCLES);
        check_same();
        if (check_state.failures > failures) {
            printf("  replay: test_cortex_m0_random %llu 1\n", (unsigned long long)seed);
            return;
        }
    }
}

/* Every third one a store: STR, STRB, STRH near a register, STM, PUSH. */
static uint16_t draw_storing(struct random_source *random)
{
    static const uint16_t stores[] = {0x6000, 0x7000, 0x8000, 0xC000, 0xB400};
    const uint16_t half = draw_half(random);
    if (random_u64(random) % 3u) {
        return half >> 12 == 0xDu || half >> 12 == 0xEu ? 0x3001u : half; /* on, not round and round */
    }
    return (uint16_t)(stores[random_u64(random) % 5u] | (half & 0x01BFu) | 1u);
}

/* A loop in RAM from its third byte on, with a call of the next instruction here and there; registers point into it. */
static void put_loop(struct bench *bench, struct random_source *random)
{
    struct cortex_m0 *const cpu = &bench->cpu;
    for (uint32_t at = 2; at < LOOP_END; at += 4) {
        const bool call = random_u64(random) % 8u == 0;
        BENCH_PUT(bench, BENCH_RAM_BASE + at, call ? 0xF000u : draw_storing(random), call ? 0xF800u : draw_storing(random));
    }
    BENCH_PUT(bench, BENCH_RAM_BASE + LOOP_END, (uint16_t)(0xE000u | ((0u - (LOOP_END + 2u) / 2u) & 0x7FFu))); /* B to 2 */
    for (unsigned r = 0; r < 8; r++) {
        cpu->r[r] = BENCH_RAM_BASE + (uint32_t)(random_u64(random) % (LOOP_END / 4u)) * 4u;
    }
    cpu->r[13] = BENCH_RAM_BASE + BENCH_RAM / 2u;
    cpu->r[15] = BENCH_RAM_BASE + 2u;
}

/* Code in RAM that stores into itself, decoded as it goes, and anew for each instruction. */
static void decoded_code_is_never_stale(void)
{
    uint64_t changes = 0;
    for (uint64_t seed = first_seed; seed < first_seed + seeds; seed++) {
        for (unsigned i = 0; i < 2; i++) {
            struct bench *const bench = i ? &cut : &whole;
            struct random_source random;
            random_init(&random, seed, 3);
            make(bench, seed);
            put_loop(bench, &random);
        }
        uint8_t before[BENCH_RAM];
        memcpy(before, whole.ram, sizeof before);
        for (unsigned i = 0; i < STEPS; i++) {
            cortex_m0_step(&whole.cpu);
            cortex_m0_changed(&cut.cpu, BENCH_RAM_BASE, LOOP_END + 4u);
            cortex_m0_step(&cut.cpu);
        }
        changes += memcmp(before, whole.ram, BENCH_RAM / 2u) != 0;
        const bool same = CHECK_BYTES(whole.cpu.r, cut.cpu.r, sizeof whole.cpu.r);
        if (!same || !CHECK_BYTES(whole.ram, cut.ram, sizeof whole.ram)) {
            printf("  replay: test_cortex_m0_random %llu 1\n", (unsigned long long)seed);
            return;
        }
    }
    printf("%llu of %llu changed themselves\n", (unsigned long long)changes, (unsigned long long)seeds);
    CHECK(changes * 2u > seeds);
}

static void nothing_leaves_its_memory(void)
{
    uint64_t faults = 0, exceptions = 0, accesses = 0, lockups = 0;
    for (uint64_t seed = first_seed; seed < first_seed + seeds; seed++) {
        struct random_source random;
        random_init(&random, seed, 2);
        make(&whole, seed);
        cortex_m0_set_account(&whole.cpu, &whole_account);
        for (uint64_t until = 0; until < CYCLES; until += random_u64(&random) % 50u) {
            whole.answer = random_u64(&random) % 8u ? CORTEX_M0_OK : CORTEX_M0_LATER;
            whole.stops = random_u64(&random) % 4u == 0;
            const unsigned irq = (unsigned)(random_u64(&random) % 32u), what = (unsigned)(random_u64(&random) % 16u);
            if (what < 2) {
                cortex_m0_set_line(&whole.cpu, irq, true);
            } else if (what == 2) {
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
    printf("seeds %llu to %llu: %llu faults, %llu handlers, %llu accesses, %llu lockups\n", (unsigned long long)first_seed,
           (unsigned long long)(first_seed + seeds - 1u), (unsigned long long)faults, (unsigned long long)exceptions,
           (unsigned long long)accesses, (unsigned long long)lockups);
    CHECK(faults > seeds && exceptions > seeds && accesses > seeds / 2u && lockups < seeds);
}

int main(int count, char **arguments)
{
    if (count == 3) {
        first_seed = strtoull(arguments[1], NULL, 10);
        seeds = strtoull(arguments[2], NULL, 10);
    }
    RUN(however_a_run_is_cut_up_it_is_the_same);
    RUN(decoded_code_is_never_stale);
    RUN(nothing_leaves_its_memory);
    cortex_m0_free(&whole.cpu);
    cortex_m0_free(&cut.cpu);
    return check_summary();
}
