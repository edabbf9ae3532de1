/* Instructions that fault, the frame of a fault, and lockup. */
#include "check.h"
#include "test_cortex_m0_bench.h"

#define NOP 0xBF00u
#define BX_LR 0x4770u
#define BIT(number) (UINT64_C(1) << (number))
#define IRQ(number) (CORTEX_M0_IRQ0 + (number))

static struct bench bench;
static struct cortex_m0 *const cpu = &bench.cpu;

/* Start a program of NOPs with all interrupts enabled. */
static void start_nop_program(void)
{
    bench_nops(&bench);
    cpu->enabled = ~UINT64_C(0);
}

struct fault_row {
    const char *name;
    uint16_t first, second;
    enum cortex_m0_fault_kind kind;
    uint32_t pc;
};

/* Preconditions: r1 RAM + 1; r2 0x40001000, no device; r3 an even address; r4 0x50000001; r5 flash. */
static const struct fault_row fault_rows[] = {
    {"LDR", 0x6808, NOP, CORTEX_M0_FAULT_UNALIGNED, BENCH_MAIN},
    {"LDRH", 0x8808, NOP, CORTEX_M0_FAULT_UNALIGNED, BENCH_MAIN},
    {"STR", 0x6008, NOP, CORTEX_M0_FAULT_UNALIGNED, BENCH_MAIN},
    {"STRH", 0x8008, NOP, CORTEX_M0_FAULT_UNALIGNED, BENCH_MAIN},
    {"LDM", 0xC901, NOP, CORTEX_M0_FAULT_UNALIGNED, BENCH_MAIN},
    {"STM", 0xC101, NOP, CORTEX_M0_FAULT_UNALIGNED, BENCH_MAIN},
    {"load from an unmapped address", 0x7810, NOP, CORTEX_M0_FAULT_BUS, BENCH_MAIN},
    {"store to an unmapped address", 0x7010, NOP, CORTEX_M0_FAULT_BUS, BENCH_MAIN},
    {"store to flash", 0x6028, NOP, CORTEX_M0_FAULT_BUS, BENCH_MAIN},
    {"BX to an even address", 0x4718, NOP, CORTEX_M0_FAULT_STATE, BENCH_MAIN + 0x10u},
    {"BX to an unmapped address", 0x4720, NOP, CORTEX_M0_FAULT_FETCH, 0x50000000u},
    {"UDF", 0xDE00, NOP, CORTEX_M0_FAULT_UNDEFINED, BENCH_MAIN},
    {"UDF.W", 0xF7F0, 0xA000, CORTEX_M0_FAULT_UNDEFINED, BENCH_MAIN},
    {"MOVW", 0xF240, 0x0000, CORTEX_M0_FAULT_UNDEFINED, BENCH_MAIN},
    {"CBZ", 0xB100, NOP, CORTEX_M0_FAULT_UNDEFINED, BENCH_MAIN},
    {"IT", 0xBF08, NOP, CORTEX_M0_FAULT_UNDEFINED, BENCH_MAIN},
    {"PUSH of an empty list", 0xB400, NOP, CORTEX_M0_FAULT_UNDEFINED, BENCH_MAIN},
    {"BKPT", 0xBE00, NOP, CORTEX_M0_FAULT_BREAKPOINT, BENCH_MAIN},
};

static void faulting_instructions_raise_a_hard_fault_at_their_address(void)
{
    for (size_t i = 0; i < sizeof fault_rows / sizeof *fault_rows; i++) {
        const struct fault_row *row = &fault_rows[i];
        start_nop_program();
        BENCH_PUT(&bench, BENCH_MAIN, row->first, row->second);
        cpu->r[1] = BENCH_RAM_BASE + 1u;
        cpu->r[2] = 0x40001000u;
        cpu->r[3] = BENCH_MAIN + 0x10u;
        cpu->r[4] = 0x50000001u;
        cpu->r[5] = 0x100;
        bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
        bool passes = CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
        passes &= CHECK_EQUAL(cpu->fault.kind, row->kind);
        passes &= CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), row->pc);
        if (!passes) {
            printf("  in %s\n", row->name);
        }
    }
}

static void a_masked_supervisor_call_faults(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_MAIN, 0xB672, 0xDF07); /* CPSID i; SVC */
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_SVC);
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), BENCH_MAIN + 2u);
}

static void a_fault_in_the_fault_handler_locks_up_until_a_reset(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_MAIN, 0xDE00);
    BENCH_PUT(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT), 0xDE00);
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_LOCKUP);
    CHECK_EQUAL(cpu->cycle, 16); /* reported without delay */
    CHECK_EQUAL(cpu->faults, 2);
    CHECK_EQUAL(cortex_m0_run(cpu, 2000), CORTEX_M0_LOCKUP);
    CHECK_EQUAL(cpu->cycle, 2000);
    cortex_m0_reset(cpu, 0);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN);
    CHECK_EQUAL(cortex_m0_run(cpu, 2010), CORTEX_M0_DEADLINE);
}

static void with_halt_on_fault_the_run_ends_before_the_fault_handler(void)
{
    start_nop_program();
    bench.config.halt_on_fault = true;
    BENCH_PROGRAM(&bench, NOP, 0xDE00);
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_FAULTED);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 2u);
    CHECK_EQUAL(cpu->cycle, 1);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
}

static void a_stack_at_an_unmapped_address_faults_and_then_locks_up(void)
{
    start_nop_program();
    cpu->r[13] = 0x30000000u;
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_STACKING);
    CHECK_EQUAL(cpu->pending, BIT(IRQ(0)));
    start_nop_program();
    bench_word(&bench, 0, 0x30000000u);
    BENCH_PUT(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT), 0xB500); /* PUSH {LR} */
    bench_reset(&bench);
    BENCH_PUT(&bench, BENCH_MAIN, 0xDE00);
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_LOCKUP);
}

static void a_return_that_contradicts_the_active_exceptions_faults(void)
{
    start_nop_program();
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    cpu->r[14] = 0xFFFFFFF1u; /* return to handler mode, but no handler is active */
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_RETURN);
    CHECK_EQUAL(cpu->active, BIT(IRQ(0)) | BIT(CORTEX_M0_HARD_FAULT));
}

static void a_frame_of_the_wrong_mode_faults(void)
{
    start_nop_program();
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    bench_word(&bench, cpu->r[13] + 28u, 0x01000010u); /* xPSR of a handler, but the return is to thread mode */
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_RETURN);
    CHECK_EQUAL(cpu->active, BIT(CORTEX_M0_HARD_FAULT));
}

static void an_unreadable_vector_faults_and_then_locks_up(void)
{
    start_nop_program();
    /* vectors of exception 15 and above lie outside flash */
    cortex_m0_set_vectors(cpu, BENCH_FLASH - 4u * (IRQ(0) - 1u));
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_VECTOR);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    start_nop_program();
    cortex_m0_set_vectors(cpu, 0x60000000u);
    cortex_m0_pulse(cpu, 0);
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_LOCKUP);
}

static void in_thread_mode_an_exc_return_address_faults(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_MAIN, BX_LR);
    cpu->r[14] = 0xFFFFFFF9u;
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_FETCH);
}

static void a_reset_without_vectors_locks_up(void)
{
    start_nop_program();
    cortex_m0_reset(cpu, 0x60000000u);
    CHECK_EQUAL(cortex_m0_run(cpu, 10), CORTEX_M0_LOCKUP);
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_VECTOR);
}

static void a_vector_without_the_thumb_bit_faults_at_its_first_instruction(void)
{
    start_nop_program();
    bench_word(&bench, 4u * IRQ(0), BENCH_HANDLER(IRQ(0)));
    cortex_m0_pulse(cpu, 0);
    bench_run_to(&bench, BENCH_HANDLER(CORTEX_M0_HARD_FAULT));
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_STATE);
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), BENCH_HANDLER(IRQ(0)));
}

int main(void)
{
    RUN(faulting_instructions_raise_a_hard_fault_at_their_address);
    RUN(a_masked_supervisor_call_faults);
    RUN(a_fault_in_the_fault_handler_locks_up_until_a_reset);
    RUN(with_halt_on_fault_the_run_ends_before_the_fault_handler);
    RUN(a_stack_at_an_unmapped_address_faults_and_then_locks_up);
    RUN(a_return_that_contradicts_the_active_exceptions_faults);
    RUN(a_frame_of_the_wrong_mode_faults);
    RUN(an_unreadable_vector_faults_and_then_locks_up);
    RUN(in_thread_mode_an_exc_return_address_faults);
    RUN(a_reset_without_vectors_locks_up);
    RUN(a_vector_without_the_thumb_bit_faults_at_its_first_instruction);
    cortex_m0_free(cpu);
    return check_summary();
}
