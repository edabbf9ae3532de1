/* The chip in virtual time: power, reset, clock, and the run loop that serves the peripheral blocks. */
#include "emulator/psoc4/psoc.h"

#include <stdio.h>
#include <string.h>

#include "emulator/psoc4/internal.h"

#define FLASH_WAIT_AFTER_RESET 0u
#define CAUSE_WATCHDOG (1u << 0)
#define CAUSE_LOCKUP (1u << 2)
#define CAUSE_SOFT (1u << 4)
#define VECTORS_IN_RAM 1u

/* Return the virtual time (picoseconds) at which the processor reaches the given cycle, at its present clock
 * frequency. */
vtime psoc_time(const struct psoc *psoc, uint64_t cycle)
{
    return psoc->origin + (vtime)((double)(cycle - psoc->origin_cycle) * psoc->ps_per_cycle);
}

/* Return the first processor cycle that does not precede a virtual time. */
uint64_t psoc_cycle(const struct psoc *psoc, vtime time)
{
    if (time <= psoc->origin) {
        return psoc->origin_cycle;
    }
    uint64_t cycle = psoc->origin_cycle + (uint64_t)((double)(time - psoc->origin) / psoc->ps_per_cycle);
    while (psoc_time(psoc, cycle) < time) {
        cycle++;
    }
    return cycle;
}

/* Set the origin of psoc_time(): the processor reaches `cycle` at the virtual time `time`. */
static void set_origin(struct psoc *psoc, vtime time, uint64_t cycle)
{
    psoc->origin = time;
    psoc->origin_cycle = cycle;
}

/* Change the clock frequency of the chip to `hz` (nominal, before the rate error of the chip) from the given cycle
 * on. */
void psoc_set_frequency(struct psoc *psoc, double hz, uint64_t cycle)
{
    set_origin(psoc, psoc_time(psoc, cycle), cycle);
    psoc->ps_per_cycle = (double)VTIME_SECOND / hz / psoc->config.clock_rate;
}

/* Set the rate of the processor's oscillator relative to its nominal frequency. */
void psoc_set_clock_rate(struct psoc *psoc, double clock_rate)
{
    const double hz = (double)VTIME_SECOND / psoc->ps_per_cycle / psoc->config.clock_rate;
    psoc->config.clock_rate = clock_rate;
    psoc_set_frequency(psoc, hz, psoc->cpu.cycle);
}

/* Return the virtual time (picoseconds) that the processor has reached. */
vtime psoc_now(const struct psoc *psoc)
{
    return psoc_time(psoc, psoc->cpu.cycle);
}

/* Set the level of interrupt line `irq` of the processor. */
void psoc_set_line(struct psoc *psoc, unsigned irq, bool high)
{
    cortex_m0_set_line(&psoc->cpu, irq, high);
    psoc->input_changed = true;
}

/* End psoc_run() after the current instruction, because the program has acted on a wire or on the flash. */
void psoc_end_run(struct psoc *psoc)
{
    psoc->has_acted = true;
    cortex_m0_stop(&psoc->cpu);
}

/* End psoc_run_until_reply() after the current instruction, because the program has answered the I2C master. */
void psoc_end_wait(struct psoc *psoc)
{
    psoc->has_replied = true;
    cortex_m0_stop(&psoc->cpu);
}

/* Report an access that the emulator does not model, and stop the processor, because the program would continue with
 * wrong values. */
void psoc_report_unmodelled(struct psoc *psoc, const char *action, uint32_t address)
{
    fprintf(stderr,
            "%s: the program at 0x%04X %s 0x%08X, which is not modelled (PERIPHERALS.md); the processor stops\n",
            psoc->name, (unsigned)psoc->cpu.r[15], action, (unsigned)address);
    psoc->has_stopped = true;
    cortex_m0_stop(&psoc->cpu);
}

/* Create an emulated chip without power: the part config->part (kind of chip and its wiring), or PSOC_PART_STANDARD if
 * it is NULL. Returns 0, or -1 if out of memory. */
int psoc_init(struct psoc *psoc, const struct psoc_config *config)
{
    memset(psoc, 0, sizeof *psoc);
    psoc->config = *config;
    psoc->config.part = config->part ? config->part : PSOC_PART_STANDARD;
    snprintf(psoc->name, sizeof psoc->name, "%s", config->name);
    /* the constant gives the chip another random sequence than other users of the seed */
    random_init(&psoc->random, config->seed ^ 0x5241Du, config->unique_id[0]);
    const struct cortex_m0_config core = {
        .flash = config->flash->bytes,
        .flash_size = psoc->config.part->flash_size,
        .ram = psoc->ram,
        .ram_base = PSOC_RAM_BASE,
        .ram_size = psoc->config.part->family->ram_size,
        .context = psoc,
        .read = psoc_on_read,
        .write = psoc_on_write,
        .timing = psoc->config.part->family->timing(),
    };
    if (cortex_m0_init(&psoc->cpu, &core)) {
        return -1;
    }
    cortex_m0_set_account(&psoc->cpu, &psoc->account);
    return 0;
}

/* Free the memory of the emulated chip. The caller owns the struct itself. */
void psoc_free(struct psoc *psoc)
{
    cortex_m0_free(&psoc->cpu);
}

/* Reset the peripheral blocks and the processor, whose first instruction follows after the reset time. RAM and virtual
 * time continue. causes: bits of the register RES_CAUSE. */
static void reset(struct psoc *psoc, vtime now, uint32_t causes)
{
    memset(&psoc->clocks, 0, sizeof psoc->clocks);
    memset(&psoc->peri, 0, sizeof psoc->peri);
    memset(&psoc->csd_words, 0, sizeof psoc->csd_words);
    memset(&psoc->cpuss, 0, sizeof psoc->cpuss);
    memset(&psoc->gpio, 0, sizeof psoc->gpio);
    psoc->csd = (struct psoc_csd){.end = PSOC_NEVER};
    for (unsigned i = 0; i < 2u; i++) {
        psoc->scb[i] = (struct psoc_scb){.number = i};
    }
    if (psoc->config.deviations.keeps_no_ram) {
        memset(psoc->ram, 0, sizeof psoc->ram);
        cortex_m0_memory_changed(&psoc->cpu, PSOC_RAM_BASE, psoc_family(psoc)->ram_size);
    }
    psoc->cpu.lines = 0;
    psoc->ps_per_cycle = (double)VTIME_SECOND / psoc_family(psoc)->hz_after_reset / psoc->config.clock_rate;
    set_origin(psoc, now + psoc->config.reset_time, psoc->cpu.cycle);
    psoc_family(psoc)->reset_srss(psoc, causes);
    cortex_m0_set_flash_wait(&psoc->cpu, FLASH_WAIT_AFTER_RESET);
    cortex_m0_reset(&psoc->cpu, 0);
    psoc->faults_before = psoc->cpu.faults;
    psoc->resets++;
    psoc->stalled_until = 0;
}

/* Power on the processor at virtual time `now`: random RAM content, as on silicon, then a reset with these cause bits.
 */
void psoc_power_on(struct psoc *psoc, vtime now, uint32_t causes)
{
    for (unsigned i = 0; i < psoc_family(psoc)->ram_size; i += 8u) {
        const uint64_t random_bytes = random_u64(&psoc->random);
        memcpy(psoc->ram + i, &random_bytes, sizeof random_bytes);
    }
    cortex_m0_memory_changed(&psoc->cpu, PSOC_RAM_BASE, psoc_family(psoc)->ram_size);
    cortex_m0_memory_changed(&psoc->cpu, 0, psoc->config.part->flash_size); /* a row may have been torn */
    psoc->powered = true;
    psoc->has_stopped = false;
    psoc->srss.cause = 0;
    reset(psoc, now, causes);
}

/* Switch the supply of the chip off: the processor executes nothing until the next power-on. */
void psoc_power_off(struct psoc *psoc)
{
    psoc->powered = false;
}

/* Reset during operation (watchdog, software or lockup): release SCL, SDA and RTS and restart the processor. RAM keeps
 * its content. */
static void reset_by(struct psoc *psoc, uint32_t cause)
{
    struct psoc_scb *const scb = psoc_bus_scb(psoc);
    const vtime now = psoc_now(psoc);
    psoc_slave_disabled(psoc, scb, psoc->cpu.cycle);
    psoc_master_disabled(psoc, scb, psoc->cpu.cycle);
    if (psoc->config.wires.i2c_drive) {
        psoc->config.wires.i2c_drive(psoc->config.wires.context, true, true);
    }
    if (psoc->config.wires.uart_hold) {
        psoc->config.wires.uart_hold(psoc->config.wires.context, false, now);
    }
    reset(psoc, now, psoc->srss.cause | cause);
    psoc->has_acted = true;
}

/* Let the processor take a HardFault at its present instruction. */
void psoc_inject_hard_fault(struct psoc *psoc)
{
    cortex_m0_inject_fault(&psoc->cpu);
    psoc->input_changed = true;
}

/* Let the conversion in progress, or the next one, end without an interrupt. */
void psoc_lose_conversion(struct psoc *psoc)
{
    psoc->csd.loses_end = true;
}

/* Return the cycle of the next event of a block: end of a conversion or watchdog reset. */
static uint64_t next_of_blocks(const struct psoc *psoc)
{
    return psoc->csd.end < psoc->srss.reset_cycle ? psoc->csd.end : psoc->srss.reset_cycle;
}

/* Execute the events of the peripheral blocks that are due: end of a conversion, and reset by the watchdog. */
static void run_blocks(struct psoc *psoc)
{
    if (psoc->csd.end <= psoc->cpu.cycle) {
        psoc_family(psoc)->end_conversion(psoc);
    }
    if (psoc->srss.reset_cycle <= psoc->cpu.cycle) {
        reset_by(psoc, CAUSE_WATCHDOG);
    }
}

/* Execute only interrupt handlers: the main program is put to sleep at its current instruction. Returns why the run of
 * the processor ended. */
static enum cortex_m0_reason run_stalled(struct psoc *psoc, uint64_t until)
{
    struct cortex_m0 *cpu = &psoc->cpu;
    const bool in_main = !cpu->ipsr && !cpu->entering && !cpu->primask;
    if (in_main && !cpu->asleep) {
        cpu->asleep = true;
        cpu->wakes_on_event = false;
        cpu->asleep_since = cpu->cycle;
        cpu->attention = true;
    }
    const uint64_t tick = cortex_m0_wake_cycle(cpu);
    if (!cpu->asleep || cpu->pending & cpu->enabled || tick <= cpu->cycle) {
        return cortex_m0_step(cpu);
    }
    return cortex_m0_run(cpu, tick < until ? tick : until);
}

/* Execute instructions up to a processor cycle, and perform a reset that they request or that a lockup causes. While a
 * stall of the main program lasts (psoc_stall()), only interrupt handlers run. */
static void run_processor(struct psoc *psoc, uint64_t until)
{
    const bool stalled = psoc->stalled_until && psoc_now(psoc) < psoc->stalled_until;
    switch (stalled ? run_stalled(psoc, until) : cortex_m0_run(&psoc->cpu, until)) {
    case CORTEX_M0_RESET_REQUESTED:
        reset_by(psoc, CAUSE_SOFT);
        break;
    case CORTEX_M0_LOCKUP:
        reset_by(psoc, CAUSE_LOCKUP);
        break;
    default:
        break;
    }
}

/* Run the chip until a virtual time or until `*is_done` becomes true. Returns `*is_done`. The chip executes nothing
 * before psoc->origin, which lies at the end of the reset time after a reset. */
static bool run(struct psoc *psoc, vtime until, const bool *is_done)
{
    psoc->input_changed = false;
    while (psoc->powered && !psoc->has_stopped && !*is_done && until > psoc->origin) {
        const uint64_t end = psoc_cycle(psoc, until), block = next_of_blocks(psoc);
        if (block <= psoc->cpu.cycle) {
            run_blocks(psoc);
        } else if (psoc->cpu.cycle >= end) {
            break;
        } else {
            run_processor(psoc, block < end ? block : end);
        }
    }
    return *is_done;
}

/* Run the chip up to the virtual time `until`, or until the program acts on a wire or on its flash. Returns true in
 * the second case. */
bool psoc_run(struct psoc *psoc, vtime until)
{
    psoc->has_acted = false;
    return run(psoc, until, &psoc->has_acted);
}

/* Run the chip up to the virtual time `until`, or until the program answers the I2C master. Returns true in the
 * second case. */
bool psoc_run_until_reply(struct psoc *psoc, vtime until)
{
    return run(psoc, until, &psoc->has_replied);
}

/* Suspend the main program up to the virtual time `until`, as if it were busy; interrupts are served. */
void psoc_stall(struct psoc *psoc, vtime until)
{
    psoc->stalled_until = until;
}

/* Return the virtual time until which the processor does nothing: the present time while it executes, otherwise its
 * next timer, conversion end or watchdog reset; VTIME_NEVER if none is scheduled. */
vtime psoc_next_event(const struct psoc *psoc)
{
    if (!psoc->powered || psoc->has_stopped) {
        return VTIME_NEVER;
    }
    if (!psoc->cpu.asleep || psoc->input_changed) {
        return psoc_now(psoc);
    }
    const uint64_t tick = cortex_m0_wake_cycle(&psoc->cpu), block = next_of_blocks(psoc);
    const uint64_t next = tick < block ? tick : block;
    if (next == PSOC_NEVER) {
        return VTIME_NEVER;
    }
    /* The timer may have expired during the last instruction of the previous run. */
    return psoc_time(psoc, next > psoc->cpu.cycle ? next : psoc->cpu.cycle);
}

/* Return whether an application is running, which moves the vectors to RAM; the bootloader does not. */
bool psoc_runs_application(const struct psoc *psoc)
{
    return psoc->powered && psoc->cpuss.config & VECTORS_IN_RAM;
}

/* Return whether a fault or a lockup of the processor has occurred since its last reset. */
bool psoc_has_faulted(const struct psoc *psoc)
{
    return psoc->cpu.faults != psoc->faults_before;
}
