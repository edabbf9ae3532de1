/* The system control space as a program accesses it, and the special registers. */
#include "check.h"
#include "test_cortex_m0_bench.h"

#define RVR 0xE000E014u
#define ISER 0xE000E100u
#define ICER 0xE000E180u
#define ISPR 0xE000E200u
#define ICPR 0xE000E280u
#define IPR(n) (0xE000E400u + 4u * (n))
#define CPUID 0xE000ED00u
#define ICSR 0xE000ED04u
#define AIRCR 0xE000ED0Cu
#define SCR 0xE000ED10u
#define CCR 0xE000ED14u
#define SHPR2 0xE000ED1Cu
#define SHPR3 0xE000ED20u

static struct bench bench;
static struct cortex_m0 *const cpu = &bench.cpu;

static void identification_and_configuration_registers_have_documented_values(void)
{
    bench_nops(&bench);
    bench_store(&bench, SCR, 0x1F);
    CHECK_EQUAL(bench_load(&bench, SCR), 0x16);
    bench_store(&bench, RVR, 0x12345678u);
    CHECK_EQUAL(bench_load(&bench, RVR), 0x345678);
    bench_store(&bench, CPUID, 0); /* read only */
    CHECK_EQUAL(bench_load(&bench, CPUID), 0x410CC200u);
    CHECK_EQUAL(bench_load(&bench, CCR), 0x208);
    CHECK_EQUAL(bench_load(&bench, AIRCR), 0xFA050000u);
    CHECK_EQUAL(bench_load(&bench, 0xE000ED08u), 0); /* no VTOR */
}

static void interrupts_are_enabled_pended_and_cleared_by_their_bits(void)
{
    bench_nops(&bench);
    bench_store(&bench, ISER, 0x80000011u);
    CHECK_EQUAL(bench_load(&bench, ISER), 0x80000011u);
    bench_store(&bench, ICER, 0x10u);
    CHECK_EQUAL(bench_load(&bench, ICER), 0x80000001u);
    bench_store(&bench, ISPR, 0x0000F000u);
    CHECK_EQUAL(bench_load(&bench, ISPR), 0x0000F000u);
    CHECK_EQUAL(bench_load(&bench, ICSR) >> 22 & 1u, 1);
    CHECK_EQUAL(bench_load(&bench, ICSR) >> 12 & 0x1FFu, 0); /* no pending interrupt is enabled */
    bench_store(&bench, ICPR, 0x00007000u);
    CHECK_EQUAL(bench_load(&bench, ICPR), 0x00008000u);
    CHECK_EQUAL(cpu->ipsr, 0);
}

static void the_interrupt_of_a_high_line_cannot_be_cleared(void)
{
    bench_nops(&bench);
    cortex_m0_set_line(cpu, 3, true);
    bench_store(&bench, ICPR, 8);
    CHECK_EQUAL(bench_load(&bench, ISPR), 8);
    cortex_m0_set_line(cpu, 3, false);
    CHECK_EQUAL(bench_load(&bench, ISPR), 8);
    bench_store(&bench, ICPR, 8);
    CHECK_EQUAL(bench_load(&bench, ISPR), 0);
}

static void priorities_have_two_bits(void)
{
    bench_nops(&bench);
    bench_store(&bench, IPR(1), 0xFF804000u);
    CHECK_EQUAL(bench_load(&bench, IPR(1)), 0xC0804000u);
    CHECK_EQUAL(bench_load(&bench, IPR(0)), 0);
    bench_store(&bench, SHPR2, 0xFFFFFFFFu);
    CHECK_EQUAL(bench_load(&bench, SHPR2), 0xC0000000u);
    bench_store(&bench, SHPR3, 0x80C00000u);
    CHECK_EQUAL(bench_load(&bench, SHPR3), 0x80C00000u);
}

static void pendsv_and_systick_are_pended_and_cleared(void)
{
    bench_nops(&bench);
    cpu->primask = true;
    /* the priorities do not matter here; the execution priority is recomputed */
    bench_store(&bench, SHPR3, 0x00C00000u);
    bench_store(&bench, ICSR, 1u << 28 | 1u << 26);
    CHECK_EQUAL(bench_load(&bench, ICSR) & 0x14000000u, 0x14000000u);
    CHECK_EQUAL(bench_load(&bench, ICSR) >> 12 & 0x1FFu, 15);
    bench_store(&bench, ICSR, 1u << 25);
    CHECK_EQUAL(bench_load(&bench, ICSR) & 0x14000000u, 0x10000000u);
    bench_store(&bench, ICSR, 1u << 27);
    CHECK_EQUAL(bench_load(&bench, ICSR), 0);
}

static void system_registers_accept_only_word_accesses(void)
{
    bench_nops(&bench);
    bench_access(&bench, 0x7008, ISER, 0); /* STRB */
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    bench_nops(&bench);
    bench_access(&bench, 0x7808, ISER, 0); /* LDRB */
    CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
    CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_BUS);
}

/* Execute MRS. Returns the value of the special register with this number. */
static uint32_t read_special(uint16_t number)
{
    BENCH_PUT(&bench, BENCH_SCRATCH, 0xF3EF, (uint16_t)(0x8000u | number)); /* MRS r0, ... */
    cpu->r[15] = BENCH_SCRATCH;
    cortex_m0_step(cpu);
    return cpu->r[0];
}

/* Execute MSR: write a value to the special register with this number. */
static void write_special(uint16_t number, uint32_t value)
{
    BENCH_PUT(&bench, BENCH_SCRATCH, 0xF380, (uint16_t)(0x8800u | number)); /* MSR ..., r0 */
    cpu->r[0] = value;
    cpu->r[15] = BENCH_SCRATCH;
    cortex_m0_step(cpu);
}

static void special_registers_are_read_and_written(void)
{
    enum { APSR, IAPSR, EAPSR, XPSR, IPSR = 5, EPSR, IEPSR, MSP, PSP, PRIMASK = 16, CONTROL = 20 };
    bench_nops(&bench);
    write_special(APSR, 0xFFFFFFFFu);
    CHECK_EQUAL(read_special(XPSR), 0xF0000000u); /* no Q, and the T bit reads as 0 */
    write_special(IPSR, 0);
    CHECK_EQUAL(read_special(IAPSR), 0xF0000000u);
    CHECK_EQUAL(read_special(EAPSR), 0xF0000000u);
    CHECK_EQUAL(read_special(IEPSR), 0);
    write_special(MSP, BENCH_RAM_BASE + 0x203u);
    write_special(PSP, BENCH_RAM_BASE + 0x102u);
    CHECK_EQUAL(cpu->r[13], BENCH_RAM_BASE + 0x200u);
    CHECK_EQUAL(read_special(MSP), BENCH_RAM_BASE + 0x200u);
    CHECK_EQUAL(read_special(PSP), BENCH_RAM_BASE + 0x100u);
    write_special(CONTROL, 0xFFFFFFFFu);
    CHECK_EQUAL(read_special(CONTROL), 2); /* this processor has no unprivileged mode */
    CHECK_EQUAL(cpu->r[13], BENCH_RAM_BASE + 0x100u);
    write_special(PSP, BENCH_RAM_BASE + 0x80u);
    CHECK_EQUAL(cpu->r[13], BENCH_RAM_BASE + 0x80u);
    CHECK_EQUAL(read_special(MSP), BENCH_RAM_BASE + 0x200u);
    write_special(PRIMASK, 0xFFFFFFFFu);
    CHECK_EQUAL(read_special(PRIMASK), 1);
    CHECK_EQUAL(cpu->faults, 0);
}

static void access_to_nonexistent_special_registers_faults(void)
{
    static const uint16_t rows[][2] = {
        {0xF3EF, 0x8004}, {0xF3EF, 0x8013}, {0xF3EF, 0x8D00}, {0xF3EF, 0x8F00}, /* MRS of 4, 19; into SP, PC */
        {0xF380, 0x8804}, {0xF380, 0x8813}, {0xF38D, 0x8800}, {0xF38F, 0x8810}, /* MSR of 4, 19; from SP, PC */
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        bench_nops(&bench);
        BENCH_PUT(&bench, BENCH_MAIN, rows[i][0], rows[i][1]);
        cortex_m0_step(cpu);
        CHECK_EQUAL(cpu->ipsr, CORTEX_M0_HARD_FAULT);
        CHECK_EQUAL(cpu->fault.kind, CORTEX_M0_FAULT_UNDEFINED);
    }
}

static void a_reset_request_requires_the_key(void)
{
    bench_nops(&bench);
    bench_store(&bench, AIRCR, 0x00000004u);
    CHECK_EQUAL(cortex_m0_run(cpu, cpu->cycle + 1u), CORTEX_M0_DEADLINE);
    bench_put(&bench, BENCH_SCRATCH, &(const uint16_t){0x6008}, 1);
    cpu->r[0] = 0x05FA0004u;
    cpu->r[1] = AIRCR;
    cpu->r[15] = BENCH_SCRATCH;
    CHECK_EQUAL(cortex_m0_run(cpu, cpu->cycle + 100u), CORTEX_M0_RESET_REQUESTED);
    CHECK_EQUAL(cpu->r[15], BENCH_SCRATCH + 2u);
}

int main(void)
{
    RUN(identification_and_configuration_registers_have_documented_values);
    RUN(interrupts_are_enabled_pended_and_cleared_by_their_bits);
    RUN(the_interrupt_of_a_high_line_cannot_be_cleared);
    RUN(priorities_have_two_bits);
    RUN(pendsv_and_systick_are_pended_and_cleared);
    RUN(system_registers_accept_only_word_accesses);
    RUN(special_registers_are_read_and_written);
    RUN(access_to_nonexistent_special_registers_faults);
    RUN(a_reset_request_requires_the_key);
    cortex_m0_free(cpu);
    return check_summary();
}
