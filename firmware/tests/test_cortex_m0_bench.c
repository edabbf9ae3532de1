#include "test_cortex_m0_bench.h"

#include <string.h>

#define BX_LR 0x4770u
#define NOP 0xBF00u
#define LDR_R0_R1 0x6808u
#define STR_R0_R1 0x6008u
#define STEPS_MAX 1000u

/* Record an access and execute it on the test port, or return the status that the test has selected; bus function of
 * the test processor. Also stops the run or raises an interrupt if the test requests it. */
static enum cortex_m0_bus_status respond(struct bench *bench, struct cortex_m0_access *access, bool write)
{
    if (bench->count < BENCH_ACCESSES) {
        bench->accesses[bench->count] = (struct bench_access){*access, write};
    }
    bench->count++;
    if (bench->status != CORTEX_M0_OK || access->address - BENCH_PORT >= sizeof bench->port) {
        return bench->status == CORTEX_M0_OK ? CORTEX_M0_ERROR : bench->status;
    }
    uint8_t *const bytes = (uint8_t *)bench->port + (access->address - BENCH_PORT);
    if (write) {
        memcpy(bytes, &access->value, access->size);
    } else {
        memcpy(&access->value, bytes, access->size);
    }
    access->stall = bench->stall;
    if (bench->raises >= 0) {
        cortex_m0_set_line(&bench->cpu, (unsigned)bench->raises, true);
    }
    if (bench->stops) {
        cortex_m0_stop(&bench->cpu);
    }
    return CORTEX_M0_OK;
}

/* Read function of the test processor's bus. */
static enum cortex_m0_bus_status on_read(void *context, struct cortex_m0_access *access)
{
    return respond(context, access, false);
}

/* Write function of the test processor's bus. */
static enum cortex_m0_bus_status on_write(void *context, struct cortex_m0_access *access)
{
    return respond(context, access, true);
}

/* Write instructions (halfwords) to flash or RAM of the test processor. */
void bench_put(struct bench *bench, uint32_t address, const uint16_t *halfwords, unsigned count)
{
    uint8_t *const memory =
        address >= BENCH_RAM_BASE ? bench->ram + (address - BENCH_RAM_BASE) : bench->flash + address;
    memcpy(memory, halfwords, count * sizeof *halfwords);
    cortex_m0_memory_changed(&bench->cpu, address, (uint32_t)(count * sizeof *halfwords));
}

/* Write a 32-bit word to flash or RAM of the test processor. */
void bench_word(struct bench *bench, uint32_t address, uint32_t value)
{
    const uint16_t halfwords[] = {(uint16_t)value, (uint16_t)(value >> 16)};
    bench_put(bench, address, halfwords, 2);
}

/* Read a 32-bit word from flash or RAM of the test processor. */
uint32_t bench_read(const struct bench *bench, uint32_t address)
{
    uint32_t value;
    memcpy(&value, address >= BENCH_RAM_BASE ? bench->ram + (address - BENCH_RAM_BASE) : bench->flash + address,
           sizeof value);
    return value;
}

/* Initialise a test processor with a vector table whose handlers return at once, and reset it. */
void bench_init(struct bench *bench)
{
    cortex_m0_free(&bench->cpu);
    memset(bench, 0, sizeof *bench);
    bench->raises = -1;
    bench->config = (struct cortex_m0_config){
        .flash = bench->flash,
        .flash_size = BENCH_FLASH,
        .ram = bench->ram,
        .ram_base = BENCH_RAM_BASE,
        .ram_size = BENCH_RAM,
        .context = bench,
        .read = on_read,
        .write = on_write,
        .timing = cortex_m0_psoc4200(),
    };
    bench->config.timing.flash_wait = 0;
    bench_reset(bench);
    bench_word(bench, 0, BENCH_STACK);
    bench_word(bench, 4, BENCH_MAIN | 1u);
    for (uint32_t i = 2; i < CORTEX_M0_EXCEPTIONS; i++) {
        bench_word(bench, 4u * i, BENCH_HANDLER(i) | 1u);
        BENCH_PUT(bench, BENCH_HANDLER(i), BX_LR);
    }
    bench_reset(bench);
}

/* Reset the test processor with its present configuration and memory, and forget the recorded accesses. */
void bench_reset(struct bench *bench)
{
    cortex_m0_free(&bench->cpu);
    cortex_m0_init(&bench->cpu, &bench->config);
    cortex_m0_reset(&bench->cpu, 0);
    bench->count = 0;
}

/* Initialise a test processor whose program consists of NOP instructions. */
void bench_nops(struct bench *bench)
{
    bench_init(bench);
    for (uint32_t i = 0; i < 64; i++) {
        bench_put(bench, BENCH_MAIN + 2u * i, &(const uint16_t){NOP}, 1);
    }
}

/* Execute one load or store with `value` in r0 and `address` in r1, and return to the program. Returns r0. */
uint32_t bench_access(struct bench *bench, uint16_t instruction, uint32_t address, uint32_t value)
{
    struct cortex_m0 *const cpu = &bench->cpu;
    const uint32_t pc = cpu->r[15];
    bench_put(bench, BENCH_SCRATCH, &instruction, 1);
    cpu->r[0] = value;
    cpu->r[1] = address;
    cpu->r[15] = BENCH_SCRATCH;
    cortex_m0_step(cpu);
    if (!cpu->ipsr) {
        cpu->r[15] = pc;
    }
    return cpu->r[0];
}

/* Execute a load of a 32-bit word by the test processor. Returns the word. */
uint32_t bench_load(struct bench *bench, uint32_t address)
{
    return bench_access(bench, LDR_R0_R1, address, 0);
}

/* Execute a store of a 32-bit word by the test processor. */
void bench_store(struct bench *bench, uint32_t address, uint32_t value)
{
    bench_access(bench, STR_R0_R1, address, value);
}

/* Execute instructions until the program counter is at `address`. Returns the number of cycles, or 0 if the address is
 * not reached within STEPS_MAX steps. */
uint64_t bench_run_to(struct bench *bench, uint32_t address)
{
    const uint64_t begin = bench->cpu.cycle;
    for (unsigned i = 0; i < STEPS_MAX; i++) {
        if (bench->cpu.r[15] == address && !bench->cpu.entering) {
            return bench->cpu.cycle - begin;
        }
        cortex_m0_step(&bench->cpu);
    }
    return 0;
}
