/* Exception entry and return: stack frames, priorities, nesting, tail-chaining, late arrival. */
#include "check.h"
#include "test_cortex_m0_bench.h"

#define NOP 0xBF00u
#define B_HERE 0xE7FEu
#define BX_LR 0x4770u
#define BIT(number) (UINT64_C(1) << (number))
#define IRQ(number) (CORTEX_M0_IRQ0 + (number))
#define ENTRY 16u
#define RETURN (3u + 12u) /* BX LR, then unstacking */
#define TAIL_CHAIN (3u + 6u)

static struct bench bench;
static struct cortex_m0 *const cpu = &bench.cpu;

/* Start a program of NOPs with all interrupts enabled; interrupt n has priority n % 4 (0 is the highest). */
static void start_nop_program(void)
{
    bench_nops(&bench);
    cpu->enabled = ~UINT64_C(0);
    cpu->level[0] = cpu->level[1] = cpu->level[2] = cpu->level[3] = 0x1111111111111111u;
    for (unsigned i = 1; i < 4; i++) {
        cpu->level[i] <<= i;
    }
}

static void an_interrupt_takes_16_cycles_and_restores_every_register(void)
{
    start_nop_program();
    for (uint32_t i = 0; i < 13; i++) {
        cpu->r[i] = 0x100u + i;
    }
    cpu->r[14] = 0x77;
    cortex_m0_set_xpsr(cpu, 0xA1000000u);
    cortex_m0_run(cpu, 3);
    uint32_t before[16];
    memcpy(before, cpu->r, sizeof before);
    cortex_m0_pulse(cpu, 4);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->cycle, 3 + ENTRY);
    CHECK_EQUAL(cpu->r[15], BENCH_HANDLER(IRQ(4)));
    CHECK_EQUAL(cpu->ipsr, IRQ(4));
    CHECK_EQUAL(cpu->r[14], 0xFFFFFFF9u);
    CHECK_EQUAL(cpu->r[13], BENCH_STACK - 32u);
    static const uint8_t in_frame[] = {0, 1, 2, 3, 12, 14, 15};
    for (uint32_t i = 0; i < 7; i++) {
        CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 4u * i), before[in_frame[i]]);
    }
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 28u), 0xA1000000u);
    cpu->r[0] = cpu->r[1] = cpu->r[2] = cpu->r[3] = 0x55;
    cortex_m0_set_xpsr(cpu, 0x51000000u);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->cycle, 3 + ENTRY + RETURN);
    CHECK_BYTES(cpu->r, before, sizeof before);
    CHECK_EQUAL(cortex_m0_xpsr(cpu), 0xA1000000u);
    CHECK_EQUAL(cpu->active, 0);
}

static void pending_interrupts_are_tail_chained_without_a_new_frame(void)
{
    start_nop_program();
    cortex_m0_pulse(cpu, 8);
    cortex_m0_pulse(cpu, 4);
    cortex_m0_pulse(cpu, 1); /* lower priority */
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(4)); /* equal priority: the lower number first */
    const uint32_t sp = cpu->r[13];
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(8));
    CHECK_EQUAL(cpu->cycle, ENTRY + TAIL_CHAIN);
    CHECK_EQUAL(cpu->r[13], sp);
    CHECK_EQUAL(cpu->r[14], 0xFFFFFFF9u);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(1));
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN);
    CHECK_EQUAL(cpu->cycle, ENTRY + 2 * TAIL_CHAIN + RETURN);
}

static void a_higher_priority_interrupt_that_arrives_during_stacking_is_served_first(void)
{
    start_nop_program();
    cortex_m0_pulse(cpu, 3);
    CHECK_EQUAL(cortex_m0_run(cpu, 11), CORTEX_M0_DEADLINE);
    CHECK_EQUAL(cpu->cycle, 11);
    CHECK_EQUAL(cpu->ipsr, 0); /* still stacking */
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(0));
    CHECK_EQUAL(cpu->cycle, ENTRY);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(3));
    CHECK_EQUAL(cpu->cycle, ENTRY + TAIL_CHAIN);
    CHECK_EQUAL(cpu->r[13], BENCH_STACK - 32u);
}

static void a_higher_priority_interrupt_that_arrives_after_stacking_preempts(void)
{
    start_nop_program();
    cortex_m0_pulse(cpu, 3);
    cortex_m0_run(cpu, 12);
    CHECK_EQUAL(cpu->cycle, ENTRY);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(0));
    CHECK_EQUAL(cpu->r[14], 0xFFFFFFF1u);
    CHECK_EQUAL(cpu->cycle, 2 * ENTRY);
    CHECK_EQUAL(cpu->active, BIT(IRQ(0)) | BIT(IRQ(3)));
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(3));
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, 0);
    CHECK_EQUAL(cpu->cycle, 2 * ENTRY + 2 * RETURN);
    CHECK_EQUAL(cpu->r[13], BENCH_STACK);
}

static void an_interrupt_of_equal_or_lower_priority_waits(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_HANDLER(IRQ(5)), NOP, NOP, BX_LR);
    cortex_m0_pulse(cpu, 5);
    cortex_m0_step(cpu);
    cortex_m0_pulse(cpu, 1);
    cortex_m0_pulse(cpu, 6);
    cortex_m0_step(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(5));
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(1));
}

static void a_line_that_stays_high_interrupts_again_and_a_pulse_does_not(void)
{
    start_nop_program();
    cortex_m0_set_line(cpu, 2, true);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->pending, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(2));
    cortex_m0_set_line(cpu, 2, false);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, 0);
    cortex_m0_set_line(cpu, 2, true); /* latched */
    cortex_m0_set_line(cpu, 2, false);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(2));
    cortex_m0_pulse(cpu, 2); /* while its handler is active: pending again */
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(2));
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, 0);
}

static void primask_holds_back_all_but_nmi_and_hard_fault(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_MAIN, 0xB672, NOP, NOP, 0xB662, NOP); /* CPSID, ..., CPSIE */
    cortex_m0_step(cpu);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, 0);
    cortex_m0_pulse_nmi(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_NMI);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, 0);
    cortex_m0_step(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 8u);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(0));
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), BENCH_MAIN + 8u);
}

static void a_supervisor_call_returns_to_the_next_instruction(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_MAIN, 0xDF07, NOP);
    cortex_m0_step(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_SVCALL);
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), BENCH_MAIN + 2u);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 2u);
}

static void a_thread_on_the_process_stack_is_stacked_there(void)
{
    start_nop_program();
    const uint32_t psp = BENCH_RAM_BASE + 0x100u;
    BENCH_PUT(&bench, BENCH_MAIN, 0xF380, 0x8809, 0xF381, 0x8814, NOP, NOP); /* MSR PSP, r0; MSR CONTROL, r1 */
    cpu->r[0] = psp;
    cpu->r[1] = 2;
    cortex_m0_step(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[13], psp);
    CHECK_EQUAL(cortex_m0_msp(cpu), BENCH_STACK);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[14], 0xFFFFFFFDu);
    CHECK_EQUAL(cpu->r[13], BENCH_STACK);
    CHECK_EQUAL(cortex_m0_psp(cpu), psp - 32u);
    CHECK_EQUAL(bench_read(&bench, psp - 8u), BENCH_MAIN + 8u);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[13], psp);
    CHECK_EQUAL(cortex_m0_lowest_psp(cpu), psp - 32u);
    CHECK_EQUAL(cortex_m0_lowest_msp(cpu), BENCH_STACK);
}

static void a_frame_is_aligned_to_8_bytes_and_the_stack_pointer_is_restored(void)
{
    start_nop_program();
    cpu->r[13] = BENCH_STACK - 4u;
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[13], BENCH_STACK - 40u);
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 28u), 0x01000000u | 1u << 9);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->r[13], BENCH_STACK - 4u);
}

static void a_register_list_is_abandoned_for_an_interrupt_and_restarted(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_MAIN, 0xCAFB, NOP); /* LDM r2!, {r0, r1, r3-r7}: 8 cycles */
    cpu->r[2] = BENCH_RAM_BASE;
    for (uint32_t i = 0; i < 7; i++) {
        bench_word(&bench, BENCH_RAM_BASE + 4u * i, i + 1u);
    }
    CHECK_EQUAL(cortex_m0_run(cpu, 5), CORTEX_M0_DEADLINE);
    CHECK_EQUAL(cpu->cycle, 5);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->cycle, 5 + ENTRY);
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), BENCH_MAIN);
    CHECK_EQUAL(cpu->r[7], 0);
    cortex_m0_step(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->cycle, 5 + ENTRY + RETURN + 8);
    CHECK_EQUAL(cpu->r[2], BENCH_RAM_BASE + 28u);
    CHECK_EQUAL(cpu->r[7], 7);
}

static void a_register_list_that_is_not_interrupted_continues_in_the_next_run(void)
{
    start_nop_program();
    BENCH_PUT(&bench, BENCH_MAIN, 0xB5FF, 0xBDFF); /* PUSH and POP of all registers */
    cpu->r[14] = (BENCH_MAIN + 8u) | 1u;
    for (uint64_t until = 1; until <= 10 + 13; until++) {
        cortex_m0_run(cpu, until);
        CHECK_EQUAL(cpu->cycle < 20 ? cpu->cycle : 23, until < 20 ? until : 23);
    }
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 8u);
}

static void vectors_may_lie_in_ram(void)
{
    start_nop_program();
    bench_word(&bench, BENCH_RAM_BASE + 4u * IRQ(0), BENCH_HANDLER(IRQ(7)) | 1u);
    cortex_m0_set_vectors(cpu, BENCH_RAM_BASE);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(0));
    CHECK_EQUAL(cpu->r[15], BENCH_HANDLER(IRQ(7)));
}

int main(void)
{
    RUN(an_interrupt_takes_16_cycles_and_restores_every_register);
    RUN(pending_interrupts_are_tail_chained_without_a_new_frame);
    RUN(a_higher_priority_interrupt_that_arrives_during_stacking_is_served_first);
    RUN(a_higher_priority_interrupt_that_arrives_after_stacking_preempts);
    RUN(an_interrupt_of_equal_or_lower_priority_waits);
    RUN(a_line_that_stays_high_interrupts_again_and_a_pulse_does_not);
    RUN(primask_holds_back_all_but_nmi_and_hard_fault);
    RUN(a_supervisor_call_returns_to_the_next_instruction);
    RUN(a_thread_on_the_process_stack_is_stacked_there);
    RUN(a_frame_is_aligned_to_8_bytes_and_the_stack_pointer_is_restored);
    RUN(a_register_list_is_abandoned_for_an_interrupt_and_restarted);
    RUN(a_register_list_that_is_not_interrupted_continues_in_the_next_run);
    RUN(vectors_may_lie_in_ram);
    cortex_m0_free(cpu);
    return check_summary();
}
