/* Implementation of the library libtaxel_cortex_m0, which tests call through a foreign function interface. */
#include "emulator/cortex_m0/native.h"

#include <stdlib.h>

#include "emulator/cortex_m0/internal.h"

#define RAM_BASE 0x20000000u

struct taxel_cortex_m0 {
    struct cortex_m0 cpu;
    struct cortex_m0_account account;
    uint8_t *flash, *ram;
};

/* Allocate a processor with zeroed flash at 0 and RAM at 0x20000000 (sizes in bytes). `flash_wait`: wait states;
 * `multiply`: cycles of MULS; `halt_flags`: TAXEL_CORTEX_M0_HALT_ON_..., causes that end a run. Returns NULL if out of
 * memory or if a size is not a multiple of 4. */
struct taxel_cortex_m0 *taxel_cortex_m0_open(uint32_t flash_size, uint32_t ram_size, uint8_t flash_wait,
                                             uint8_t multiply, int halt_flags)
{
    struct taxel_cortex_m0 *const core = calloc(1, sizeof *core);
    if (!core) {
        return NULL;
    }
    core->flash = calloc(1, flash_size + 1u); /* + 1: a size of 0 is allowed */
    core->ram = calloc(1, ram_size + 1u);
    struct cortex_m0_config config = {
        .flash = core->flash,
        .flash_size = flash_size,
        .ram = core->ram,
        .ram_base = RAM_BASE,
        .ram_size = ram_size,
        .timing = cortex_m0_psoc4200(),
        .halt_on_breakpoint = halt_flags & TAXEL_CORTEX_M0_HALT_ON_BREAKPOINT,
        .halt_on_fault = halt_flags & TAXEL_CORTEX_M0_HALT_ON_FAULT,
    };
    config.timing.flash_wait = flash_wait;
    config.timing.multiply = multiply;
    if (!core->flash || !core->ram || cortex_m0_init(&core->cpu, &config)) {
        taxel_cortex_m0_close(core);
        return NULL;
    }
    return core;
}

/* Free a processor with its memories; NULL is allowed. */
void taxel_cortex_m0_close(struct taxel_cortex_m0 *core)
{
    if (core) {
        cortex_m0_free(&core->cpu);
        free(core->flash);
        free(core->ram);
        free(core);
    }
}

/* Return a pointer to `size` bytes of flash or RAM; NULL unless the whole range lies in one of them. */
static uint8_t *memory_at(struct taxel_cortex_m0 *core, uint32_t address, uint32_t size)
{
    const uint32_t flash_size = core->cpu.config.flash_size, ram_size = core->cpu.config.ram_size;
    if (address < flash_size && size <= flash_size - address) {
        return core->flash + address;
    }
    const uint32_t offset = address - RAM_BASE;
    return offset < ram_size && size <= ram_size - offset ? core->ram + offset : NULL;
}

/* Copy bytes to flash or RAM from outside the processor and discard the instructions decoded there. Returns -1 unless
 * the whole range lies in one memory. */
int taxel_cortex_m0_write_memory(struct taxel_cortex_m0 *core, uint32_t address, const uint8_t *bytes, uint32_t size)
{
    uint8_t *const memory = memory_at(core, address, size);
    if (!memory) {
        return -1;
    }
    memcpy(memory, bytes, size);
    cortex_m0_memory_changed(&core->cpu, address, size);
    return 0;
}

/* Copy bytes from flash or RAM. Returns -1 unless the whole range lies in one memory. */
int taxel_cortex_m0_read_memory(struct taxel_cortex_m0 *core, uint32_t address, uint8_t *bytes, uint32_t size)
{
    const uint8_t *const memory = memory_at(core, address, size);
    if (!memory) {
        return -1;
    }
    memcpy(bytes, memory, size);
    return 0;
}

/* Reset the processor: stack pointer and program counter come from the vector table at address `vectors`. */
void taxel_cortex_m0_reset(struct taxel_cortex_m0 *core, uint32_t vectors)
{
    cortex_m0_reset(&core->cpu, vectors);
}

/* Run the processor until its cycle counter reaches `until`. Returns why the run ended (enum cortex_m0_reason). */
int taxel_cortex_m0_run(struct taxel_cortex_m0 *core, uint64_t until)
{
    return (int)cortex_m0_run(&core->cpu, until);
}

/* Execute one instruction or one exception entry. Returns why the step ended (enum cortex_m0_reason). */
int taxel_cortex_m0_step(struct taxel_cortex_m0 *core)
{
    return (int)cortex_m0_step(&core->cpu);
}

/* Execute instructions and exception entries until the cycle `until`, or until one of them ends for a reason other than
 * the deadline. Returns their number, without the one that ended for another reason. */
uint64_t taxel_cortex_m0_count_instructions(struct taxel_cortex_m0 *core, uint64_t until)
{
    uint64_t count = 0;
    while (core->cpu.cycle < until && cortex_m0_step(&core->cpu) == CORTEX_M0_DEADLINE) {
        count++;
    }
    return count;
}

/* Advance the program counter over the BKPT instruction, 2 bytes, at which the processor halted. */
void taxel_cortex_m0_skip_breakpoint(struct taxel_cortex_m0 *core)
{
    core->cpu.r[CORTEX_M0_PC] += 2u;
}

/* Set the level of interrupt line `irq`: 1 high, 0 low. */
void taxel_cortex_m0_set_line(struct taxel_cortex_m0 *core, unsigned irq, int high)
{
    cortex_m0_set_line(&core->cpu, irq % CORTEX_M0_IRQS, high);
}

/* Return the cycle counter of the processor. */
uint64_t taxel_cortex_m0_get_cycle(const struct taxel_cortex_m0 *core)
{
    return core->cpu.cycle;
}

/* Copy registers, flags, both stack pointers and the latest fault to `state`. */
void taxel_cortex_m0_get_state(const struct taxel_cortex_m0 *core, struct taxel_cortex_m0_state *state)
{
    const struct cortex_m0 *const cpu = &core->cpu;
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

/* Set registers, flags and stack pointers, in thread mode without active or pending exceptions. r[13] is MSP unless
 * `control` selects PSP. */
void taxel_cortex_m0_set_state(struct taxel_cortex_m0 *core, const struct taxel_cortex_m0_state *state)
{
    struct cortex_m0 *const cpu = &core->cpu;
    cpu->process_stack = state->control & 2u;
    memcpy(cpu->r, state->r, sizeof cpu->r);
    cpu->other_sp = cpu->process_stack ? state->msp : state->psp;
    cpu->r[CORTEX_M0_SP] &= ~UINT32_C(3);
    cortex_m0_reset_stack_marks(cpu);
    cpu->primask = state->primask & 1u;
    cpu->ipsr = 0;
    cpu->fault = (struct cortex_m0_fault){0};
    cpu->fault_pending = cpu->asleep = cpu->event = cpu->entering = cpu->locked_up = cpu->lockup_reported = false;
    cpu->progress = 0;
    cortex_m0_reset_nvic(cpu);
    cortex_m0_set_xpsr(cpu, state->xpsr);
}

/* Execute one instruction from each of `count` independent states and overwrite each state by the result and its
 * cycles. One call for many states avoids the cost of a foreign function call per instruction. */
void taxel_cortex_m0_run_cases(struct taxel_cortex_m0 *core, struct taxel_cortex_m0_state *states, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        const uint64_t begin = core->cpu.cycle;
        taxel_cortex_m0_set_state(core, &states[i]);
        states[i].reason = (uint32_t)cortex_m0_step(&core->cpu);
        taxel_cortex_m0_get_state(core, &states[i]);
        states[i].cycles = (uint32_t)(core->cpu.cycle - begin);
    }
}

/* Switch the counting of cycles per exception handler on (1, from zero) or off (0). */
void taxel_cortex_m0_set_accounting(struct taxel_cortex_m0 *core, int on)
{
    cortex_m0_set_account(&core->cpu, on ? &core->account : NULL);
}

/* Copy the counted cycles of the handler of exception number `exception` to `cost`. */
void taxel_cortex_m0_get_cost(const struct taxel_cortex_m0 *core, unsigned exception, struct cortex_m0_cost *cost)
{
    *cost = core->account.cost[exception % CORTEX_M0_EXCEPTIONS];
}
