/* A bare processor for a caller through a foreign function interface: the tests' library, libtaxel_cortex_m0. */
#include "emulator/cortex_m0/native.h"

#include <stdlib.h>

#include "emulator/cortex_m0/parts.h"

#define RAM_BASE 0x20000000u

struct taxel_cortex_m0 {
    struct cortex_m0 cpu;
    struct cortex_m0_account account;
    uint8_t *flash, *ram;
};

struct taxel_cortex_m0 *taxel_cortex_m0_open(uint32_t flash_size, uint32_t ram_size, uint8_t flash_wait, uint8_t multiply,
                                             int halts)
{
    struct taxel_cortex_m0 *const bare = calloc(1, sizeof *bare);
    if (!bare) {
        return NULL;
    }
    bare->flash = calloc(1, flash_size + 1u);
    bare->ram = calloc(1, ram_size + 1u);
    struct cortex_m0_config config = {
        .flash = bare->flash,
        .flash_size = flash_size,
        .ram = bare->ram,
        .ram_base = RAM_BASE,
        .ram_size = ram_size,
        .timing = cortex_m0_psoc4200(),
        .halt_on_breakpoint = halts & TAXEL_CORTEX_M0_HALT_ON_BREAKPOINT,
        .halt_on_fault = halts & TAXEL_CORTEX_M0_HALT_ON_FAULT,
    };
    config.timing.flash_wait = flash_wait;
    config.timing.multiply = multiply;
    if (!bare->flash || !bare->ram || cortex_m0_init(&bare->cpu, &config)) {
        taxel_cortex_m0_close(bare);
        return NULL;
    }
    return bare;
}

void taxel_cortex_m0_close(struct taxel_cortex_m0 *bare)
{
    if (bare) {
        cortex_m0_free(&bare->cpu);
        free(bare->flash);
        free(bare->ram);
        free(bare);
    }
}

/* Flash, then RAM; NULL if not all of it lies in one of them. */
static uint8_t *memory_at(struct taxel_cortex_m0 *bare, uint32_t address, uint32_t size)
{
    const uint32_t flash_size = bare->cpu.config.flash_size, ram_size = bare->cpu.config.ram_size;
    if (address < flash_size && size <= flash_size - address) {
        return bare->flash + address;
    }
    const uint32_t offset = address - RAM_BASE;
    return offset < ram_size && size <= ram_size - offset ? bare->ram + offset : NULL;
}

int taxel_cortex_m0_load(struct taxel_cortex_m0 *bare, uint32_t address, const uint8_t *bytes, uint32_t size)
{
    uint8_t *const memory = memory_at(bare, address, size);
    if (!memory) {
        return -1;
    }
    memcpy(memory, bytes, size);
    cortex_m0_changed(&bare->cpu, address, size);
    return 0;
}

int taxel_cortex_m0_memory(struct taxel_cortex_m0 *bare, uint32_t address, uint8_t *bytes, uint32_t size)
{
    const uint8_t *const memory = memory_at(bare, address, size);
    if (!memory) {
        return -1;
    }
    memcpy(bytes, memory, size);
    return 0;
}

void taxel_cortex_m0_reset(struct taxel_cortex_m0 *bare, uint32_t vectors)
{
    cortex_m0_reset(&bare->cpu, vectors);
}

int taxel_cortex_m0_run(struct taxel_cortex_m0 *bare, uint64_t until)
{
    return (int)cortex_m0_run(&bare->cpu, until);
}

int taxel_cortex_m0_step(struct taxel_cortex_m0 *bare)
{
    return (int)cortex_m0_step(&bare->cpu);
}

uint64_t taxel_cortex_m0_instructions(struct taxel_cortex_m0 *bare, uint64_t until)
{
    uint64_t count = 0;
    while (bare->cpu.cycle < until && cortex_m0_step(&bare->cpu) == CORTEX_M0_TIME) {
        count++;
    }
    return count;
}

void taxel_cortex_m0_skip(struct taxel_cortex_m0 *bare)
{
    bare->cpu.r[CORTEX_M0_PC] += 2u;
}

void taxel_cortex_m0_set_line(struct taxel_cortex_m0 *bare, unsigned irq, int high)
{
    cortex_m0_set_line(&bare->cpu, irq % CORTEX_M0_IRQS, high);
}

uint64_t taxel_cortex_m0_cycle(const struct taxel_cortex_m0 *bare)
{
    return bare->cpu.cycle;
}

void taxel_cortex_m0_registers(const struct taxel_cortex_m0 *bare, struct taxel_cortex_m0_state *state)
{
    const struct cortex_m0 *const cpu = &bare->cpu;
    memcpy(state->r, cpu->r, sizeof state->r);
    state->xpsr = cortex_m0_xpsr(cpu);
    state->msp = cortex_m0_msp(cpu);
    state->psp = cortex_m0_psp(cpu);
    state->primask = cpu->primask;
    state->control = cpu->process_stack ? 2u : 0;
    state->fault = (uint32_t)cpu->fault.kind;
    state->fault_address = cpu->fault.address;
    state->lowest_msp = cortex_m0_lowest_msp(cpu);
}

/* Thread mode, no exception active or pending; MSP in r[13] unless `control` says otherwise. */
void taxel_cortex_m0_set_registers(struct taxel_cortex_m0 *bare, const struct taxel_cortex_m0_state *state)
{
    struct cortex_m0 *const cpu = &bare->cpu;
    cpu->process_stack = state->control & 2u;
    memcpy(cpu->r, state->r, sizeof cpu->r);
    cpu->other_sp = cpu->process_stack ? state->msp : state->psp;
    cpu->r[CORTEX_M0_SP] &= ~UINT32_C(3);
    cortex_m0_forget_stack(cpu);
    cpu->primask = state->primask & 1u;
    cpu->ipsr = 0;
    cpu->fault = (struct cortex_m0_fault){0};
    cpu->fault_waits = cpu->asleep = cpu->event = cpu->entering = cpu->locked_up = cpu->lockup_told = false;
    cpu->progress = 0;
    cortex_m0_reset_nvic(cpu);
    cortex_m0_set_xpsr(cpu, state->xpsr);
}

void taxel_cortex_m0_cases(struct taxel_cortex_m0 *bare, struct taxel_cortex_m0_state *states, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        const uint64_t begin = bare->cpu.cycle;
        taxel_cortex_m0_set_registers(bare, &states[i]);
        states[i].reason = (uint32_t)cortex_m0_step(&bare->cpu);
        taxel_cortex_m0_registers(bare, &states[i]);
        states[i].cycles = (uint32_t)(bare->cpu.cycle - begin);
    }
}

void taxel_cortex_m0_account(struct taxel_cortex_m0 *bare, int on)
{
    cortex_m0_set_account(&bare->cpu, on ? &bare->account : NULL);
}

void taxel_cortex_m0_cost(const struct taxel_cortex_m0 *bare, unsigned exception, struct cortex_m0_cost *cost)
{
    *cost = bare->account.cost[exception % CORTEX_M0_EXCEPTIONS];
}
