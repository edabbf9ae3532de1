/* C interface of the library libtaxel_cortex_m0: a processor with flash at 0 and RAM at 0x20000000, without
 * peripherals. */
#ifndef CORTEX_M0_NATIVE_H
#define CORTEX_M0_NATIVE_H

#include "emulator/cortex_m0/cortex_m0.h"

#define TAXEL_CORTEX_M0_HALT_ON_BREAKPOINT 1
#define TAXEL_CORTEX_M0_HALT_ON_FAULT 2

struct taxel_cortex_m0;

/* Registers and result of one instruction. All members are words, so that a caller can define an array of records. */
struct taxel_cortex_m0_state {
    uint32_t r[16];
    uint32_t xpsr, msp, psp, primask, control;
    uint32_t reason;               /* written by taxel_cortex_m0_run_cases(): enum cortex_m0_reason */
    uint32_t cycles;               /* of the instruction */
    uint32_t fault, fault_address; /* enum cortex_m0_fault_kind */
    uint32_t lowest_msp;
};

/* Create a processor. Returns NULL if out of memory or if a size is not a multiple of 4. halt_flags: sum of
 * TAXEL_CORTEX_M0_HALT_*. */
struct taxel_cortex_m0 *taxel_cortex_m0_open(uint32_t flash_size, uint32_t ram_size, uint8_t flash_wait,
                                             uint8_t multiply, int halt_flags);
void taxel_cortex_m0_close(struct taxel_cortex_m0 *core);

/* Write and read flash or RAM. Return -1 unless the whole range lies in one of the two memories. */
int taxel_cortex_m0_write_memory(struct taxel_cortex_m0 *core, uint32_t address, const uint8_t *bytes, uint32_t size);
int taxel_cortex_m0_read_memory(struct taxel_cortex_m0 *core, uint32_t address, uint8_t *bytes, uint32_t size);

void taxel_cortex_m0_reset(struct taxel_cortex_m0 *core, uint32_t vectors);
/* Run until a cycle, or execute one instruction or exception entry. Both return an enum cortex_m0_reason. */
int taxel_cortex_m0_run(struct taxel_cortex_m0 *core, uint64_t until);
int taxel_cortex_m0_step(struct taxel_cortex_m0 *core);
/* Step until the cycle `until`, or until a step ends for a reason other than the deadline. Returns the number of steps
 * that ended by the deadline. */
uint64_t taxel_cortex_m0_count_instructions(struct taxel_cortex_m0 *core, uint64_t until);
void taxel_cortex_m0_skip_breakpoint(struct taxel_cortex_m0 *core); /* step over the BKPT at r[15] */
void taxel_cortex_m0_set_line(struct taxel_cortex_m0 *core, unsigned irq, int high);

uint64_t taxel_cortex_m0_get_cycle(const struct taxel_cortex_m0 *core);
void taxel_cortex_m0_get_state(const struct taxel_cortex_m0 *core, struct taxel_cortex_m0_state *state);
void taxel_cortex_m0_set_state(struct taxel_cortex_m0 *core, const struct taxel_cortex_m0_state *state);
/* Execute one instruction from each state and replace the state by the result. */
void taxel_cortex_m0_run_cases(struct taxel_cortex_m0 *core, struct taxel_cortex_m0_state *states, uint32_t count);

void taxel_cortex_m0_set_accounting(struct taxel_cortex_m0 *core, int on);
void taxel_cortex_m0_get_cost(const struct taxel_cortex_m0 *core, unsigned exception, struct cortex_m0_cost *cost);

#endif
