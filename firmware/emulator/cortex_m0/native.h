/* The library libtaxel_cortex_m0: a processor with flash at 0 and RAM at 0x20000000, and no peripherals. */
#ifndef CORTEX_M0_NATIVE_H
#define CORTEX_M0_NATIVE_H

#include "emulator/cortex_m0/cortex_m0.h"

#define TAXEL_CORTEX_M0_HALT_ON_BREAKPOINT 1
#define TAXEL_CORTEX_M0_HALT_ON_FAULT 2

struct taxel_cortex_m0;

/* All of it words, so that a caller can lay out an array of them. */
struct taxel_cortex_m0_state {
    uint32_t r[16];
    uint32_t xpsr, msp, psp, primask, control;
    uint32_t reason;                     /* of taxel_cortex_m0_cases(): enum cortex_m0_reason */
    uint32_t cycles;                     /* of that instruction */
    uint32_t fault, fault_address;       /* enum cortex_m0_fault_kind */
    uint32_t lowest_msp;
};

/* NULL: no memory, or sizes that are not multiples of 4. */
struct taxel_cortex_m0 *taxel_cortex_m0_open(uint32_t flash_size, uint32_t ram_size, uint8_t flash_wait, uint8_t multiply,
                                             int halts);
void taxel_cortex_m0_close(struct taxel_cortex_m0 *bare);

/* Into flash or RAM, and out of it; -1 if it does not all lie in one of them. */
int taxel_cortex_m0_load(struct taxel_cortex_m0 *bare, uint32_t address, const uint8_t *bytes, uint32_t size);
int taxel_cortex_m0_memory(struct taxel_cortex_m0 *bare, uint32_t address, uint8_t *bytes, uint32_t size);

void taxel_cortex_m0_reset(struct taxel_cortex_m0 *bare, uint32_t vectors);
/* enum cortex_m0_reason */
int taxel_cortex_m0_run(struct taxel_cortex_m0 *bare, uint64_t until);
int taxel_cortex_m0_step(struct taxel_cortex_m0 *bare);
/* Steps until that cycle or until something else than time ends one; how many. */
uint64_t taxel_cortex_m0_instructions(struct taxel_cortex_m0 *bare, uint64_t until);
void taxel_cortex_m0_skip(struct taxel_cortex_m0 *bare); /* the breakpoint at which it stands */
void taxel_cortex_m0_set_line(struct taxel_cortex_m0 *bare, unsigned irq, int high);

uint64_t taxel_cortex_m0_cycle(const struct taxel_cortex_m0 *bare);
void taxel_cortex_m0_registers(const struct taxel_cortex_m0 *bare, struct taxel_cortex_m0_state *state);
void taxel_cortex_m0_set_registers(struct taxel_cortex_m0 *bare, const struct taxel_cortex_m0_state *state);
/* From each state one instruction; the state becomes that after it. */
void taxel_cortex_m0_cases(struct taxel_cortex_m0 *bare, struct taxel_cortex_m0_state *states, uint32_t count);

void taxel_cortex_m0_account(struct taxel_cortex_m0 *bare, int on);
void taxel_cortex_m0_cost(const struct taxel_cortex_m0 *bare, unsigned exception, struct cortex_m0_cost *cost);

#endif
