/* Decoded instructions: invalidation after changes by the program or the caller, ends of the memory, breakpoints. */
#include "check.h"
#include "test_cortex_m0_bench.h"

#define NOP 0xBF00u

static struct bench bench;
static struct cortex_m0 *const cpu = &bench.cpu;

/* The code in RAM overwrites an instruction that follows it directly. */
static void code_in_ram_may_modify_itself(void)
{
    bench_init(&bench);
    /* ADDS r0, #1; STRH r1, [r2]; ADDS r0, #1; BX LR */
    BENCH_PUT(&bench, BENCH_RAM_BASE, 0x3001, 0x8011, 0x3001, 0x4770);
    for (unsigned turn = 0; turn < 3; turn++) {
        cpu->r[1] = 0x3010u + turn; /* ADDS r0, #16 + turn */
        cpu->r[2] = BENCH_RAM_BASE + 4u;
        cpu->r[0] = 0;
        cpu->r[14] = BENCH_MAIN | 1u;
        cpu->r[15] = BENCH_RAM_BASE;
        bench_run_to(&bench, BENCH_MAIN);
        CHECK_EQUAL(cpu->r[0], 1 + 16 + turn);
    }
}

/* The first decoded instruction is the upper half of a stored word; stores by STR, STM, STRB and STRH. */
static void a_store_of_any_width_invalidates_the_decoded_instructions(void)
{
    static const struct {
        uint16_t instruction;
        uint32_t offset;
    } stores[] = {{0x6011, 0}, {0xC203, 0}, {0x7011, 2}, {0x8011, 2}}; /* STR, STM {r0, r1}, STRB, STRH to [r2] */
    for (size_t i = 0; i < sizeof stores / sizeof *stores; i++) {
        bench_init(&bench);
        BENCH_PROGRAM(&bench, stores[i].instruction);
        BENCH_PUT(&bench, BENCH_RAM_BASE + 2u, 0x3401, 0xE7FE); /* ADDS r4, #1 */
        cpu->r[15] = BENCH_RAM_BASE + 2u;
        cortex_m0_step(cpu);
        cpu->r[0] = 0x34090000u; /* ADDS r4, #9 */
        cpu->r[1] = i < 2 ? 0x34090000u : 0x3409u;
        cpu->r[2] = BENCH_RAM_BASE + stores[i].offset;
        cpu->r[15] = BENCH_MAIN;
        cortex_m0_step(cpu);
        cpu->r[15] = BENCH_RAM_BASE + 2u;
        cortex_m0_step(cpu);
        CHECK_EQUAL(cpu->r[4], 1 + 9);
    }
}

static void one_half_of_a_32_bit_instruction_may_change(void)
{
    bench_init(&bench);
    BENCH_PUT(&bench, BENCH_RAM_BASE, 0xF000, 0xF802, 0xE7FE, 0xBF00, 0x4770, 0x4770); /* BL to 8 */
    BENCH_PUT(&bench, BENCH_MAIN, 0x8011);
    cpu->r[15] = BENCH_RAM_BASE;
    CHECK_EQUAL(bench_run_to(&bench, BENCH_RAM_BASE + 8u), 4);
    cpu->r[1] = 0xF803; /* BL to 10 */
    cpu->r[2] = BENCH_RAM_BASE + 2u;
    cpu->r[15] = BENCH_MAIN;
    cortex_m0_step(cpu);
    cpu->r[15] = BENCH_RAM_BASE;
    CHECK_EQUAL(bench_run_to(&bench, BENCH_RAM_BASE + 10u), 4);
}

static void a_written_flash_row_is_decoded_again(void)
{
    bench_init(&bench);
    BENCH_PROGRAM(&bench, 0x3001, 0xE7FD); /* ADDS r0, #1; B */
    cortex_m0_run(cpu, 4);
    CHECK_EQUAL(cpu->r[0], 1);
    memcpy(bench.flash + BENCH_MAIN, &(const uint16_t){0x3005}, 2);
    cortex_m0_memory_changed(cpu, BENCH_MAIN & ~127u, 128);
    cortex_m0_run(cpu, 8);
    CHECK_EQUAL(cpu->r[0], 6);
    cortex_m0_memory_changed(cpu, 0, UINT32_MAX); /* the whole address space */
    cortex_m0_memory_changed(cpu, 0xFFFFFF00u, 0x100);
    cortex_m0_run(cpu, 12);
    CHECK_EQUAL(cpu->r[0], 11);
}

static void execution_beyond_the_end_of_memory_faults(void)
{
    bench_init(&bench);
    BENCH_PUT(&bench, BENCH_FLASH - 2u, NOP);
    cpu->r[15] = BENCH_FLASH - 2u;
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_FETCH);
    CHECK_EQUAL(cpu->fault.pc, BENCH_FLASH);
    bench_init(&bench);
    BENCH_PUT(&bench, BENCH_FLASH - 2u, 0xF000); /* the first half of BL */
    cpu->r[15] = BENCH_FLASH - 2u;
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_FETCH);
    CHECK_EQUAL(cpu->fault.pc, BENCH_FLASH - 2u);
    CHECK_EQUAL(cpu->fault.address, BENCH_FLASH);
    cortex_m0_memory_changed(cpu, 0, UINT32_MAX); /* the end marker of the memory must survive */
    cpu->r[15] = BENCH_FLASH - 2u;
    cpu->ipsr = 0;
    cpu->active = 0;
    BENCH_PUT(&bench, BENCH_FLASH - 2u, NOP);
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.pc, BENCH_FLASH);
}

/* Every condition is evaluated with all flags, once for a target in flash and once for a target below address 0. */
static void conditional_branches_out_of_memory_are_taken_like_branches_within(void)
{
    bench_init(&bench);
    for (uint32_t flags = 0; flags < 16; flags++) {
        for (uint32_t condition = 0; condition < 14; condition++) {
            const uint16_t back = (uint16_t)(0xD080u | condition << 8); /* B<cond> to 252 bytes before */
            uint32_t after[2];
            for (unsigned out = 0; out < 2; out++) {
                const uint32_t at = out ? 0xF0u : 0xE00u;
                bench_put(&bench, at, &back, 1);
                cpu->r[15] = at;
                cortex_m0_set_xpsr(cpu, flags << 28 | 1u << 24);
                cortex_m0_run(cpu, cpu->cycle + 1u);
                after[out] = cpu->r[15] - at;
            }
            CHECK(after[0] == 2 || after[0] == 0u - 252u);
            CHECK_EQUAL(after[0], after[1]);
        }
    }
    BENCH_PUT(&bench, 0xF0, 0xE400); /* B to 2044 bytes before */
    cpu->r[15] = 0xF0;
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[15], 0xF0u - 2044u);
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_FETCH);
}

static void a_breakpoint_halts_the_run_if_configured(void)
{
    bench_init(&bench);
    bench.config.halt_on_breakpoint = true;
    BENCH_PROGRAM(&bench, NOP, 0xBE01, NOP);
    for (unsigned i = 0; i < 2; i++) {
        CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_BREAKPOINT);
        CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 2u);
        CHECK_EQUAL(cpu->cycle, 1);
    }
}

int main(void)
{
    RUN(code_in_ram_may_modify_itself);
    RUN(a_store_of_any_width_invalidates_the_decoded_instructions);
    RUN(one_half_of_a_32_bit_instruction_may_change);
    RUN(a_written_flash_row_is_decoded_again);
    RUN(execution_beyond_the_end_of_memory_faults);
    RUN(conditional_branches_out_of_memory_are_taken_like_branches_within);
    RUN(a_breakpoint_halts_the_run_if_configured);
    cortex_m0_free(cpu);
    return check_summary();
}
