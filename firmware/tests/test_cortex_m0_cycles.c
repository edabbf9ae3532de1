/* Cycle counts compared with table 3-1 of the Cortex-M0 manual (ARM DDI 0432C), and with sequences counted by hand from
 * that table. Zero wait states and a single-cycle multiplier unless stated otherwise. */
#include "check.h"
#include "test_cortex_m0_bench.h"

static struct bench bench;

struct row {
    const char *name;
    uint16_t first, second;
    unsigned cycles;
};

/* Preconditions: r1 is an address in RAM, r2 is 0, r3 is BENCH_MAIN + 0x41, r4 is 4, Z is set. */
static const struct row table[] = {
    {"MOVS r0, #1", 0x2001, 0, 1},
    {"MOVS r0, r1", 0x0008, 0, 1},
    {"MOV r8, r0", 0x4680, 0, 1},
    {"MOV PC, r3", 0x469F, 0, 3},
    {"ADDS r0, r1, #1", 0x1C48, 0, 1},
    {"ADDS r0, r1, r2", 0x1888, 0, 1},
    {"ADD r0, r8", 0x4440, 0, 1},
    {"ADD PC, r4", 0x44A7, 0, 3},
    {"ADDS r0, #1", 0x3001, 0, 1},
    {"ADCS r0, r1", 0x4148, 0, 1},
    {"ADD SP, #4", 0xB001, 0, 1},
    {"ADD r0, SP, #4", 0xA801, 0, 1},
    {"ADR r0, here", 0xA000, 0, 1},
    {"SUBS r0, r1, r2", 0x1A88, 0, 1},
    {"SUBS r0, r1, #1", 0x1E48, 0, 1},
    {"SUBS r0, #1", 0x3801, 0, 1},
    {"SBCS r0, r1", 0x4188, 0, 1},
    {"SUB SP, #4", 0xB081, 0, 1},
    {"RSBS r0, r1, #0", 0x4248, 0, 1},
    {"MULS r0, r1", 0x4348, 0, 1},
    {"CMP r0, r1", 0x4288, 0, 1},
    {"CMN r0, r1", 0x42C8, 0, 1},
    {"CMP r0, #1", 0x2801, 0, 1},
    {"CMP r0, r8", 0x4540, 0, 1},
    {"ANDS r0, r1", 0x4008, 0, 1},
    {"EORS r0, r1", 0x4048, 0, 1},
    {"ORRS r0, r1", 0x4308, 0, 1},
    {"BICS r0, r1", 0x4388, 0, 1},
    {"MVNS r0, r1", 0x43C8, 0, 1},
    {"TST r0, r1", 0x4208, 0, 1},
    {"LSLS r0, r1, #3", 0x00C8, 0, 1},
    {"LSLS r0, r4", 0x40A0, 0, 1},
    {"LSRS r0, r1, #3", 0x08C8, 0, 1},
    {"LSRS r0, r4", 0x40E0, 0, 1},
    {"ASRS r0, r1, #3", 0x10C8, 0, 1},
    {"ASRS r0, r4", 0x4120, 0, 1},
    {"RORS r0, r4", 0x41E0, 0, 1},
    {"LDR r0, [r1, #0]", 0x6808, 0, 2},
    {"LDRH r0, [r1, #0]", 0x8808, 0, 2},
    {"LDRB r0, [r1, #0]", 0x7808, 0, 2},
    {"LDR r0, [r1, r2]", 0x5888, 0, 2},
    {"LDRH r0, [r1, r2]", 0x5A88, 0, 2},
    {"LDRSH r0, [r1, r2]", 0x5E88, 0, 2},
    {"LDRB r0, [r1, r2]", 0x5C88, 0, 2},
    {"LDRSB r0, [r1, r2]", 0x5688, 0, 2},
    {"LDR r0, here", 0x4800, 0, 2},
    {"LDR r0, [SP, #0]", 0x9800, 0, 2},
    {"LDM r1!, {r0}", 0xC901, 0, 2},
    {"LDM r1!, {r0, r2, r5}", 0xC925, 0, 4},
    {"LDM r1, {r0, r1}", 0xC903, 0, 3},
    {"STR r0, [r1, #0]", 0x6008, 0, 2},
    {"STRH r0, [r1, #0]", 0x8008, 0, 2},
    {"STRB r0, [r1, #0]", 0x7008, 0, 2},
    {"STR r0, [r1, r2]", 0x5088, 0, 2},
    {"STRH r0, [r1, r2]", 0x5288, 0, 2},
    {"STRB r0, [r1, r2]", 0x5488, 0, 2},
    {"STR r0, [SP, #0]", 0x9000, 0, 2},
    {"STM r1!, {r0, r2, r5}", 0xC125, 0, 4},
    {"PUSH {r0, r1}", 0xB403, 0, 3},
    {"PUSH {r0, r1, LR}", 0xB503, 0, 4},
    {"POP {r0, r1}", 0xBC03, 0, 3},
    {"POP {r0, PC}", 0xBD01, 0, 6},
    {"BEQ, taken", 0xD010, 0, 3},
    {"BNE, not taken", 0xD110, 0, 1},
    {"B", 0xE010, 0, 3},
    {"BL", 0xF000, 0xF810, 4},
    {"BX r3", 0x4718, 0, 3},
    {"BLX r3", 0x4798, 0, 3},
    {"SXTH r0, r1", 0xB208, 0, 1},
    {"SXTB r0, r1", 0xB248, 0, 1},
    {"UXTH r0, r1", 0xB288, 0, 1},
    {"UXTB r0, r1", 0xB2C8, 0, 1},
    {"REV r0, r1", 0xBA08, 0, 1},
    {"REV16 r0, r1", 0xBA48, 0, 1},
    {"REVSH r0, r1", 0xBAC8, 0, 1},
    {"CPSID i", 0xB672, 0, 1},
    {"CPSIE i", 0xB662, 0, 1},
    {"MRS r0, PRIMASK", 0xF3EF, 0x8010, 4},
    {"MSR PRIMASK, r2", 0xF382, 0x8810, 4},
    {"SEV", 0xBF40, 0, 1},
    {"WFE", 0xBF20, 0, 2},
    {"WFI", 0xBF30, 0, 2},
    {"YIELD", 0xBF10, 0, 1},
    {"NOP", 0xBF00, 0, 1},
    {"ISB", 0xF3BF, 0x8F6F, 4},
    {"DMB", 0xF3BF, 0x8F5F, 4},
    {"DSB", 0xF3BF, 0x8F4F, 4},
};

/* Prepare the instruction of one row of the table of cycles, with addresses of RAM and code in the registers that it
 * uses. */
static void prepare(const struct row *row)
{
    BENCH_PROGRAM(&bench, row->first, row->second);
    struct cortex_m0 *const cpu = &bench.cpu;
    cpu->r[1] = BENCH_RAM_BASE + 0x100u;
    cpu->r[3] = (BENCH_MAIN + 0x40u) | 1u;
    cpu->r[4] = 4;
    cpu->r[13] = BENCH_RAM_BASE + 0x200u;
    cpu->event = true; /* WFE then does not sleep */
    cortex_m0_set_xpsr(cpu, 0x41000000u);
    bench_word(&bench, BENCH_RAM_BASE + 0x204u, BENCH_MAIN | 1u); /* value that POP loads into PC */
}

static void every_instruction_takes_the_cycles_of_the_manual(void)
{
    bench_init(&bench);
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        prepare(&table[i]);
        cortex_m0_run(&bench.cpu, bench.cpu.cycle + 1u);
        uint64_t cycles = bench.cpu.cycle;
        if (bench.cpu.progress) { /* the run ended within a register list */
            cortex_m0_step(&bench.cpu);
            cycles = bench.cpu.cycle;
        }
        if (!CHECK_EQUAL(cycles, table[i].cycles)) {
            printf("  in %s\n", table[i].name);
        }
        CHECK_EQUAL(bench.cpu.faults, 0);
    }
}

static void the_iterative_multiplier_takes_32_cycles(void)
{
    bench_init(&bench);
    bench.config.timing.multiply = 32;
    BENCH_PROGRAM(&bench, 0x4348); /* MULS r0, r1 */
    cortex_m0_step(&bench.cpu);
    CHECK_EQUAL(bench.cpu.cycle, 32);
}

/* movs r0,#100 (1); 100 times: ldr r2,[r1] (2), str r2,[r3] (2), adds r1,#4 (1), adds r3,#4 (1), subs r0,#1 (1), bne:
 * 99 times 3 and once 1. */
static void a_copy_loop_takes_the_cycles_counted_by_hand(void)
{
    bench_init(&bench);
    BENCH_PROGRAM(&bench, 0x2064, 0x680A, 0x601A, 0x3104, 0x3304, 0x3801, 0xD1F9, 0xE7FE);
    bench.cpu.r[1] = BENCH_RAM_BASE;
    bench.cpu.r[3] = BENCH_RAM_BASE + 0x200u;
    for (uint32_t i = 0; i < 100; i++) {
        bench_word(&bench, BENCH_RAM_BASE + 4u * i, i * 0x01010101u);
    }
    CHECK_EQUAL(bench_run_to(&bench, BENCH_MAIN + 14u), 1 + 100 * (2 + 2 + 1 + 1 + 1) + 99 * 3 + 1);
    CHECK_BYTES(bench.ram + 0x200, bench.ram, 400);
}

/* main: bl f (4), then the branch to itself. f: push {r4,lr} (1+2), movs r4,#3 (1), muls r4,r4 (1), mov r0,r4 (1), pop
 * {r4,pc} (4+2). */
static void a_function_call_takes_the_cycles_counted_by_hand(void)
{
    bench_init(&bench);
    BENCH_PROGRAM(&bench, 0xF000, 0xF802, 0xE7FE, 0xBF00, 0xB510, 0x2403, 0x4364, 0x4620, 0xBD10);
    CHECK_EQUAL(bench_run_to(&bench, BENCH_MAIN + 4u), 4 + 3 + 1 + 1 + 1 + 6);
    CHECK_EQUAL(bench.cpu.r[0], 9);
    CHECK_EQUAL(bench.cpu.r[13], BENCH_STACK);
}

/* With one wait state, the first fetch after a taken branch and each data read from flash take one more cycle: ldr r0,
 * literal (2+1), ldr r2,[r1] from RAM (2), b (3+1), bx (3+1), bl (4+1), pop pc (5+1); sequential instructions take
 * none. */
static void flash_wait_states_delay_branches_and_literals(void)
{
    bench_init(&bench);
    bench.config.timing.flash_wait = 1;
    BENCH_PROGRAM(&bench, 0x4800, 0x680A, 0xE7FF, 0x4718, 0xF000, 0xF800, 0xBD00, 0xBF00, 0xBF00);
    bench.cpu.r[1] = BENCH_RAM_BASE;
    bench.cpu.r[3] = (BENCH_MAIN + 8u) | 1u;
    bench.cpu.r[13] = BENCH_RAM_BASE + 0x80u;
    bench_word(&bench, BENCH_RAM_BASE + 0x80u, (BENCH_MAIN + 14u) | 1u);
    static const unsigned cycles[] = {3, 2, 4, 4, 5, 6, 1, 1};
    for (size_t i = 0; i < sizeof cycles / sizeof *cycles; i++) {
        const uint64_t begin = bench.cpu.cycle;
        cortex_m0_step(&bench.cpu);
        CHECK_EQUAL(bench.cpu.cycle - begin, cycles[i]);
    }
    cortex_m0_set_flash_wait(&bench.cpu, 0);
    bench.cpu.r[15] = BENCH_MAIN;
    const uint64_t begin = bench.cpu.cycle;
    cortex_m0_step(&bench.cpu);
    CHECK_EQUAL(bench.cpu.cycle - begin, 2);
}

/* Cortex-M0+: b (2), bx (2), bl (3), pop pc (3+1), mrs (3), msr (3), dsb (3), adds (1), beq taken (2). Its pipeline has
 * two stages: a taken branch costs one cycle less than on the Cortex-M0. */
static void a_cortex_m0_plus_takes_the_cycles_of_its_own_manual(void)
{
    bench_init(&bench);
    bench.config.timing = cortex_m0_psoc4100s();
    bench.config.timing.flash_wait = 0;
    BENCH_PROGRAM(&bench, 0xE7FF, 0x4718, 0xF000, 0xF800, 0xBD00, 0xF3EF, 0x8008, 0xF380, 0x8808, 0xF3BF, 0x8F4F,
                  0x3100, 0xD0FF);
    bench.cpu.r[3] = (BENCH_MAIN + 4u) | 1u;
    bench.cpu.r[13] = BENCH_RAM_BASE + 0x80u;
    bench_word(&bench, BENCH_RAM_BASE + 0x80u, (BENCH_MAIN + 10u) | 1u);
    static const unsigned cycles[] = {2, 2, 3, 4, 3, 3, 3, 1, 2};
    for (size_t i = 0; i < sizeof cycles / sizeof *cycles; i++) {
        const uint64_t begin = bench.cpu.cycle;
        cortex_m0_step(&bench.cpu);
        CHECK_EQUAL(bench.cpu.cycle - begin, cycles[i]);
    }
    CHECK_EQUAL(bench.cpu.faults, 0);
}

static void code_in_ram_has_no_wait_states(void)
{
    bench_init(&bench);
    bench.config.timing.flash_wait = 1;
    BENCH_PROGRAM(&bench, 0x4718);                             /* BX r3 */
    BENCH_PUT(&bench, BENCH_RAM_BASE, 0xE7FF, 0xE7FF, 0x4720); /* B, B, BX r4 */
    bench.cpu.r[3] = BENCH_RAM_BASE | 1u;
    bench.cpu.r[4] = BENCH_MAIN | 1u;
    CHECK_EQUAL(bench_run_to(&bench, BENCH_RAM_BASE + 4u), 3 + 3 + 3);
    CHECK_EQUAL(bench_run_to(&bench, BENCH_MAIN), 3 + 1);
}

static void a_run_ends_at_the_first_instruction_that_reaches_its_cycle(void)
{
    bench_init(&bench);
    BENCH_PROGRAM(&bench, 0x3001, 0x3001, 0xE7FC); /* ADDS, ADDS, B: 5 cycles per iteration */
    CHECK_EQUAL(cortex_m0_run(&bench.cpu, 0), CORTEX_M0_DEADLINE);
    CHECK_EQUAL(bench.cpu.r[0], 0);
    CHECK_EQUAL(cortex_m0_run(&bench.cpu, 2), CORTEX_M0_DEADLINE);
    CHECK_EQUAL(bench.cpu.cycle, 2);
    CHECK_EQUAL(cortex_m0_run(&bench.cpu, 3), CORTEX_M0_DEADLINE);
    CHECK_EQUAL(bench.cpu.cycle, 5);
    CHECK_EQUAL(cortex_m0_run(&bench.cpu, 5000000), CORTEX_M0_DEADLINE);
    CHECK_EQUAL(bench.cpu.cycle, 5000000);
    CHECK_EQUAL(bench.cpu.r[0], 2000000);
}

static void dividing_a_run_into_slices_does_not_change_the_result(void)
{
    uint32_t whole[16];
    for (unsigned slice = 10007; slice; slice /= 7) {
        bench_init(&bench);
        /* push {r0-r3}; pop {r4-r7}; adds r0,#1; muls r1,r0; stm/ldm; b */
        BENCH_PROGRAM(&bench, 0xB40F, 0xBCF0, 0x3001, 0x4341, 0x466A, 0x3A40, 0xC203, 0x3A08, 0xCA60, 0xE7F5);
        for (uint64_t until = slice; bench.cpu.cycle < 10007; until += slice) {
            cortex_m0_run(&bench.cpu, until < 10007 ? until : 10007);
        }
        if (slice == 10007) {
            memcpy(whole, bench.cpu.r, sizeof whole);
        }
        CHECK_BYTES(bench.cpu.r, whole, sizeof whole);
    }
}

int main(void)
{
    RUN(every_instruction_takes_the_cycles_of_the_manual);
    RUN(the_iterative_multiplier_takes_32_cycles);
    RUN(a_copy_loop_takes_the_cycles_counted_by_hand);
    RUN(a_function_call_takes_the_cycles_counted_by_hand);
    RUN(flash_wait_states_delay_branches_and_literals);
    RUN(a_cortex_m0_plus_takes_the_cycles_of_its_own_manual);
    RUN(code_in_ram_has_no_wait_states);
    RUN(a_run_ends_at_the_first_instruction_that_reaches_its_cycle);
    RUN(dividing_a_run_into_slices_does_not_change_the_result);
    bench_init(&bench);
    cortex_m0_free(&bench.cpu);
    return check_summary();
}
