/* Interface between processor and caller: bus accesses with their cycles, stalls, stops, retried accesses, and cycle
 * accounting. */
#include "check.h"
#include "test_cortex_m0_bench.h"

#define NOP 0xBF00u
#define IRQ(number) (CORTEX_M0_IRQ0 + (number))
#define LDR_R0_R1 0x6808u
#define STR_R0_R1 0x6008u

static struct bench bench;
static struct cortex_m0 *const cpu = &bench.cpu;

/* Prepare a program whose second instruction accesses the test port on the bus, and execute the first instruction
 * (NOP), so that the access begins in cycle 1. */
static void prepare_port_access(uint16_t instruction)
{
    bench_init(&bench);
    BENCH_PROGRAM(&bench, NOP, instruction, NOP, NOP);
    cpu->r[1] = BENCH_PORT;
    cortex_m0_step(cpu);
}

static void a_bus_access_reports_address_cycle_and_size(void)
{
    static const struct {
        uint16_t instruction;
        uint8_t size;
        bool write;
        uint32_t value, loaded;
    } rows[] = {
        {0x6808, 4, false, 0, 0x89ABCDEFu}, {0x8808, 2, false, 0, 0xCDEF},      {0x7808, 1, false, 0, 0xEF},
        {0x5688, 1, false, 0, 0xFFFFFFEFu}, {0x5E88, 2, false, 0, 0xFFFFCDEFu}, {0x6008, 4, true, 0x12345678u, 0},
        {0x8008, 2, true, 0x5678, 0},       {0x7008, 1, true, 0x78, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        prepare_port_access(rows[i].instruction);
        bench.port[0] = 0x89ABCDEFu;
        cpu->r[0] = 0x12345678u;
        cortex_m0_step(cpu);
        const struct bench_access *const recorded = &bench.accesses[0];
        CHECK_EQUAL(bench.count, 1);
        CHECK_EQUAL(recorded->write, rows[i].write);
        CHECK_EQUAL(recorded->access.address, BENCH_PORT);
        CHECK_EQUAL(recorded->access.size, rows[i].size);
        CHECK_EQUAL(recorded->access.value, rows[i].value);
        CHECK_EQUAL(recorded->access.cycle, 2); /* the NOP, the address phase, then the data phase */
        CHECK_EQUAL(cpu->r[0], rows[i].write ? 0x12345678u : rows[i].loaded);
        CHECK_EQUAL(cpu->cycle, 3);
    }
}

static void wait_states_of_a_peripheral_delay_the_instruction(void)
{
    prepare_port_access(LDR_R0_R1);
    bench.stall = 7;
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->cycle, 3 + 7);
}

static void a_list_of_registers_is_accessed_word_by_word(void)
{
    prepare_port_access(0xC90D); /* LDM r1!, {r0, r2, r3} */
    bench.stall = 2;
    for (uint32_t i = 0; i < 3; i++) {
        bench.port[i] = i + 1u;
    }
    cortex_m0_step(cpu);
    CHECK_EQUAL(bench.count, 3);
    for (uint32_t i = 0; i < 3; i++) {
        CHECK_EQUAL(bench.accesses[i].access.address, BENCH_PORT + 4u * i);
        CHECK_EQUAL(bench.accesses[i].access.cycle, 2 + i * 3);
    }
    CHECK_EQUAL(cpu->r[0] << 8 | cpu->r[2] << 4 | cpu->r[3], 0x123);
    CHECK_EQUAL(cpu->r[1], BENCH_PORT + 12u);
    CHECK_EQUAL(cpu->cycle, 1 + 4 + 6);
}

static void a_register_list_that_faults_midway_leaves_the_registers_unchanged(void)
{
    prepare_port_access(0xC90D);
    cpu->r[1] = BENCH_PORT + sizeof bench.port - 4u;
    bench.port[7] = 77;
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    CHECK_EQUAL(cpu->fault.address, BENCH_PORT + sizeof bench.port);
    CHECK_EQUAL(cpu->r[0], 0);
    CHECK_EQUAL(cpu->r[1], BENCH_PORT + sizeof bench.port - 4u);
}

static void a_stack_may_lie_outside_ram(void)
{
    bench_init(&bench);
    BENCH_PROGRAM(&bench, 0xB503, 0xBC04, 0xBD08, 0xBF00); /* PUSH {r0, r1, LR}; POP {r2}; POP {r3, PC} */
    cpu->r[0] = 10;
    cpu->r[1] = 11;
    cpu->r[13] = BENCH_PORT + 16u;
    cortex_m0_reset_stack_marks(cpu);
    cpu->r[14] = (BENCH_MAIN + 6u) | 1u;
    CHECK_EQUAL(bench_run_to(&bench, BENCH_MAIN + 6u), 4 + 2 + 6);
    CHECK_EQUAL(cpu->r[2], 10);
    CHECK_EQUAL(cpu->r[3], 11);
    CHECK_EQUAL(cpu->r[13], BENCH_PORT + 16u);
    CHECK_EQUAL(cortex_m0_lowest_msp(cpu), BENCH_PORT + 4u);
    CHECK_EQUAL(bench.count, 6);
}

static void a_callback_can_stop_the_run_after_its_instruction(void)
{
    prepare_port_access(STR_R0_R1);
    bench.stops = true;
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_STOPPED);
    CHECK_EQUAL(cpu->cycle, 3);
    CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 4u);
    CHECK_EQUAL(cortex_m0_run(cpu, 4), CORTEX_M0_DEADLINE);
    CHECK_EQUAL(bench.count, 1);
    cortex_m0_stop(cpu);
    CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_STOPPED);
    CHECK_EQUAL(cpu->cycle, 4);
}

static void an_access_can_be_retried_in_a_later_run(void)
{
    prepare_port_access(STR_R0_R1);
    cpu->r[0] = 5;
    bench.status = CORTEX_M0_RETRY;
    for (int i = 0; i < 3; i++) {
        CHECK_EQUAL(cortex_m0_run(cpu, 1000), CORTEX_M0_BUS_RETRY);
        CHECK_EQUAL(cpu->cycle, 1);
        CHECK_EQUAL(cpu->r[15], BENCH_MAIN + 2u);
    }
    bench.status = CORTEX_M0_OK;
    cortex_m0_run(cpu, 3);
    CHECK_EQUAL(bench.count, 4);
    CHECK_EQUAL(bench.port[0], 5);
    CHECK_EQUAL(cpu->cycle, 3);
}

static void an_interrupt_raised_during_a_retry_is_served_before_the_access(void)
{
    prepare_port_access(STR_R0_R1);
    cpu->enabled |= UINT64_C(1) << IRQ(0);
    bench.status = CORTEX_M0_RETRY;
    cortex_m0_run(cpu, 1000);
    cortex_m0_pulse(cpu, 0);
    bench.status = CORTEX_M0_OK;
    cortex_m0_step(cpu);
    CHECK_EQUAL(cpu->ipsr, IRQ(0));
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), BENCH_MAIN + 2u);
    CHECK_EQUAL(bench.count, 1);
}

static void an_interrupt_raised_by_an_access_is_taken_after_its_instruction(void)
{
    prepare_port_access(STR_R0_R1);
    cpu->enabled |= UINT64_C(1) << IRQ(6);
    bench.raises = 6;
    cortex_m0_run(cpu, 4);
    CHECK_EQUAL(bench.count, 1);
    cortex_m0_run(cpu, 3 + 16);
    CHECK_EQUAL(cpu->ipsr, IRQ(6));
    CHECK_EQUAL(cpu->cycle, 3 + 16);
    CHECK_EQUAL(bench_read(&bench, cpu->r[13] + 24u), BENCH_MAIN + 4u);
}

static void a_store_to_flash_calls_the_write_callback(void)
{
    prepare_port_access(STR_R0_R1);
    cpu->r[1] = 0xA00;
    cortex_m0_step(cpu);
    CHECK_EQUAL(bench.accesses[0].access.address, 0xA00);
    CHECK(bench.accesses[0].write);
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    CHECK_EQUAL(bench_read(&bench, 0xA00), 0);
}

/* One store and one load. */
static void without_callbacks_every_bus_access_faults(void)
{
    bench_init(&bench);
    bench.config.read = NULL;
    bench.config.write = NULL;
    for (unsigned i = 0; i < 2; i++) {
        BENCH_PROGRAM(&bench, i ? LDR_R0_R1 : STR_R0_R1);
        cpu->r[1] = BENCH_PORT;
        cortex_m0_step(cpu);
        CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    }
}

/* Interrupt 1 (lower priority) executes NOP NOP BX; interrupt 0 (empty handler) is raised in its second instruction. */
static void exclusive_cycles_of_a_handler_exclude_preempting_handlers(void)
{
    struct cortex_m0_account account;
    bench_init(&bench);
    BENCH_PROGRAM(&bench, NOP, NOP, NOP);
    BENCH_PUT(&bench, BENCH_HANDLER(IRQ(1)), NOP, NOP, 0x4770);
    cortex_m0_set_account(cpu, &account);
    cpu->enabled |= UINT64_C(3) << IRQ(0);
    cpu->level[0] &= ~(UINT64_C(1) << IRQ(1));
    cpu->level[2] |= UINT64_C(1) << IRQ(1);
    cortex_m0_pulse(cpu, 1);
    cortex_m0_run(cpu, 17);
    cortex_m0_pulse(cpu, 0);
    bench_run_to(&bench, BENCH_MAIN);
    const struct cortex_m0_cost *const outer = &account.cost[IRQ(1)], *const inner = &account.cost[IRQ(0)];
    CHECK_EQUAL(inner->count, 1);
    CHECK_EQUAL(inner->exclusive, 16 + 3 + 12);
    CHECK_EQUAL(inner->inclusive, 16 + 3 + 12);
    CHECK_EQUAL(outer->count, 1);
    CHECK_EQUAL(outer->exclusive, 16 + 1 + 1 + 3 + 12);
    CHECK_EQUAL(outer->inclusive, outer->exclusive + inner->exclusive);
    CHECK_EQUAL(account.depth_max, 2);
    CHECK_EQUAL(account.depth, 0);
    CHECK_EQUAL(cpu->cycle, outer->inclusive);
    CHECK_EQUAL(BENCH_STACK - cortex_m0_lowest_msp(cpu), 64); /* two frames */
}

static void accounting_started_inside_a_handler_counts_from_the_next_handler(void)
{
    struct cortex_m0_account account;
    bench_init(&bench);
    BENCH_PROGRAM(&bench, NOP, NOP, NOP);
    cpu->enabled |= UINT64_C(1) << IRQ(0);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    cortex_m0_set_account(cpu, &account);
    cortex_m0_step(cpu);
    CHECK_EQUAL(account.cost[IRQ(0)].count, 0);
    cortex_m0_pulse(cpu, 0);
    cortex_m0_step(cpu);
    cortex_m0_step(cpu);
    CHECK_EQUAL(account.cost[IRQ(0)].count, 1);
}

static void the_minimum_of_the_stack_pointer_is_recorded(void)
{
    bench_init(&bench);
    /* push, sub, add, pop; mov SP, SP - 100 */
    BENCH_PROGRAM(&bench, 0xB5F0, 0xB084, 0xB004, 0xBCF0, 0x466A, 0x3A64, 0x4695);
    bench_run_to(&bench, BENCH_MAIN + 8u);
    CHECK_EQUAL(BENCH_STACK - cortex_m0_lowest_msp(cpu), 20 + 16);
    bench_run_to(&bench, BENCH_MAIN + 14u);
    CHECK_EQUAL(BENCH_STACK - cortex_m0_lowest_msp(cpu), 4 + 100);
    cortex_m0_reset_stack_marks(cpu);
    CHECK_EQUAL(cortex_m0_lowest_msp(cpu), cpu->r[13]);
}

static void invalid_memory_configurations_are_rejected(void)
{
    struct cortex_m0 other;
    bench_init(&bench);
    struct cortex_m0_config config = bench.config;
    config.flash_size = 10;
    CHECK_EQUAL(cortex_m0_init(&other, &config), -1);
    config = bench.config;
    config.ram_base = 2;
    CHECK_EQUAL(cortex_m0_init(&other, &config), -1);
    config = bench.config;
    config.ram = NULL;
    CHECK_EQUAL(cortex_m0_init(&other, &config), -1);
}

int main(void)
{
    RUN(a_bus_access_reports_address_cycle_and_size);
    RUN(wait_states_of_a_peripheral_delay_the_instruction);
    RUN(a_list_of_registers_is_accessed_word_by_word);
    RUN(a_register_list_that_faults_midway_leaves_the_registers_unchanged);
    RUN(a_stack_may_lie_outside_ram);
    RUN(a_callback_can_stop_the_run_after_its_instruction);
    RUN(an_access_can_be_retried_in_a_later_run);
    RUN(an_interrupt_raised_during_a_retry_is_served_before_the_access);
    RUN(an_interrupt_raised_by_an_access_is_taken_after_its_instruction);
    RUN(a_store_to_flash_calls_the_write_callback);
    RUN(without_callbacks_every_bus_access_faults);
    RUN(exclusive_cycles_of_a_handler_exclude_preempting_handlers);
    RUN(accounting_started_inside_a_handler_counts_from_the_next_handler);
    RUN(the_minimum_of_the_stack_pointer_is_recorded);
    RUN(invalid_memory_configurations_are_rejected);
    cortex_m0_free(cpu);
    return check_summary();
}
