/* Emulated ARMv6-M processor (Cortex-M0 or Cortex-M0+) that executes unmodified Thumb images: exceptions, NVIC, SysTick,
 * faults, and the cycle counts of the manuals (ARM DDI 0432C and DDI 0484C, table 3-1).
 *
 * Flash and RAM are memory of the caller and are accessed directly; every other access calls one of two functions of
 * the caller. The caller sets the cycle up to which the processor runs. No state is shared between processors: a
 * process may create any number of them, and each is used by one thread at a time.
 *
 * Integration (`read_peripheral`, `write_peripheral`: functions of type cortex_m0_access_function):
 *
 *     static struct cortex_m0 cpu;
 *     const struct cortex_m0_config config = {
 *         .flash = flash, .flash_base = 0, .flash_size = sizeof flash,
 *         .ram = ram, .ram_base = 0x20000000u, .ram_size = sizeof ram,
 *         .context = NULL, .read = read_peripheral, .write = write_peripheral,
 *         .timing = {.multiply = 1, .flash_wait = 1},  // further members: README.md
 *     };
 *     if (cortex_m0_init(&cpu, &config)) {
 *         return -1;
 *     }
 *     cortex_m0_reset(&cpu, 0);            // vector table at address 0
 *     cortex_m0_set_line(&cpu, 10, true);  // raise the line of interrupt 10
 *     reason = cortex_m0_run(&cpu, 48000000u);
 */
#ifndef CORTEX_M0_H
#define CORTEX_M0_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CORTEX_M0_IRQS 32u
#define CORTEX_M0_EXCEPTIONS 48u /* exception numbers; interrupt n has number 16 + n */

enum cortex_m0_exception {
    CORTEX_M0_THREAD = 0,
    CORTEX_M0_RESET = 1,
    CORTEX_M0_NMI = 2,
    CORTEX_M0_HARD_FAULT = 3,
    CORTEX_M0_SVCALL = 11,
    CORTEX_M0_PENDSV = 14,
    CORTEX_M0_SYSTICK = 15,
    CORTEX_M0_IRQ0 = 16,
};

/* Reason for which cortex_m0_run() returned. */
enum cortex_m0_reason {
    CORTEX_M0_DEADLINE,        /* `until` was reached */
    CORTEX_M0_ASLEEP,          /* `until` was reached while the processor was in WFI or WFE */
    CORTEX_M0_STOPPED,         /* cortex_m0_stop() was called; the current instruction was completed */
    CORTEX_M0_BUS_RETRY,       /* a bus access returned CORTEX_M0_RETRY; its instruction has not been executed */
    CORTEX_M0_BREAKPOINT,      /* at a BKPT, which has not been executed (halt_on_breakpoint) */
    CORTEX_M0_FAULTED,         /* at an instruction that faults; the next run enters HardFault (halt_on_fault) */
    CORTEX_M0_RESET_REQUESTED, /* AIRCR.SYSRESETREQ was written */
    /* fault in HardFault or NMI; later runs only advance the cycle until cortex_m0_reset() */
    CORTEX_M0_LOCKUP,
};

enum cortex_m0_bus_status {
    CORTEX_M0_OK,
    CORTEX_M0_ERROR, /* no device at the address: HardFault */
    /* The access had no effect; cortex_m0_run() returns, and the next run repeats the access. Allowed for the first
     * access of a register list only, and not for stacking: elsewhere the processor treats this status as
     * CORTEX_M0_ERROR. */
    CORTEX_M0_RETRY,
};

/* One bus access outside flash and RAM. */
struct cortex_m0_access {
    uint64_t cycle;   /* of the data phase */
    uint32_t address; /* a multiple of size */
    uint32_t value;   /* value to write, or the result of a read; upper bits beyond `size` are ignored */
    uint32_t stall;   /* set by the callback: wait states, cycles */
    uint8_t size;     /* bytes: 1, 2 or 4 */
};

typedef enum cortex_m0_bus_status cortex_m0_access_function(void *context, struct cortex_m0_access *access);

/* Timing parameters, cycles. Manuals: DDI 0432C (Cortex-M0), DDI 0484C (Cortex-M0+, whose pipeline has two stages
 * instead of three). Values that no public document states are marked (confirm). */
struct cortex_m0_timing {
    uint8_t taken_branch;    /* B, BX and BLX; a BL takes one cycle more: 3 (Cortex-M0) or 2 (Cortex-M0+) */
    uint8_t special;         /* MRS, MSR and barriers: 4 (Cortex-M0) or 3 (Cortex-M0+) */
    uint8_t multiply;        /* MULS: 1 (single-cycle multiplier: PSoC 4200, data sheet 001-87197, and 4100S) or 32 */
    uint8_t flash_wait;      /* wait states at the clock of the part, see README.md (confirm) */
    uint8_t exception_entry; /* 16 (Cortex-M0) or 15 (Cortex-M0+): "interrupt latency", memory without wait states */
    /* 12 or 11: assumed equal to POP of 8 registers with PC, which transfers the same words (confirm) */
    uint8_t exception_return;
    uint8_t tail_chain; /* 6: figure of the Cortex-M3, DDI 0337; not published for the others (confirm) */
    /* part of an entry within which a higher-priority exception replaces the first: 12 or 11 (confirm) */
    uint8_t late_arrival;
};

struct cortex_m0_config {
    const uint8_t *flash; /* [flash_size] readable and executable; after a change call cortex_m0_memory_changed() */
    uint32_t flash_base, flash_size;         /* address and size in bytes, multiples of 4 */
    uint8_t *ram;                            /* [ram_size] readable, writable and executable */
    uint32_t ram_base, ram_size;             /* address and size in bytes, multiples of 4 */
    void *context;                           /* argument of `read` and `write`; may be NULL */
    cortex_m0_access_function *read, *write; /* stores to flash call `write`; NULL: every access faults */
    struct cortex_m0_timing timing;
    uint32_t systick_reference;   /* cycles of one tick of SysTick's reference clock; 0: no reference clock */
    uint32_t systick_calibration; /* SYST_CALIB */
    bool halt_on_breakpoint;      /* otherwise a BKPT is a HardFault, as without a debugger */
    bool halt_on_fault;           /* end the run at a fault, before its handler */
};

enum cortex_m0_fault_kind {
    CORTEX_M0_FAULT_NONE,
    CORTEX_M0_FAULT_UNDEFINED, /* undefined or unpredictable instruction */
    CORTEX_M0_FAULT_UNALIGNED,
    CORTEX_M0_FAULT_BUS,   /* data access: no device at the address, or a store to flash */
    CORTEX_M0_FAULT_FETCH, /* instruction fetch: no executable memory at the address */
    CORTEX_M0_FAULT_STATE, /* branch to an even address (leaves Thumb state) */
    CORTEX_M0_FAULT_BREAKPOINT,
    CORTEX_M0_FAULT_SVC,      /* SVC at a priority that forbids it */
    CORTEX_M0_FAULT_RETURN,   /* EXC_RETURN that contradicts the active exceptions */
    CORTEX_M0_FAULT_STACKING, /* exception frame could not be written or read */
    CORTEX_M0_FAULT_VECTOR,   /* vector could not be read */
};

struct cortex_m0_fault {
    enum cortex_m0_fault_kind kind;
    uint32_t pc;
    uint32_t address; /* of the data, the branch target or the vector */
    uint64_t cycle;
};

/* Cycles of one exception's handler, from the first cycle of its entry to the last cycle of its return. */
struct cortex_m0_cost {
    uint64_t count;
    /* without the exceptions that preempted the handler */
    uint64_t exclusive, exclusive_min, exclusive_max;
    uint64_t inclusive, inclusive_min, inclusive_max; /* with the exceptions that preempted the handler */
    uint64_t latency, latency_max;                    /* from pending to the first cycle of the entry */
};

struct cortex_m0_account {
    struct cortex_m0_cost cost[CORTEX_M0_EXCEPTIONS];
    struct {
        uint64_t begin, inner;
        uint8_t number;
    } open[CORTEX_M0_EXCEPTIONS];
    unsigned depth;
    unsigned depth_max; /* largest nesting depth */
};

struct cortex_m0_operation; /* decoded instruction */

/* Executable memory with its decoded instructions. */
struct cortex_m0_code {
    const uint8_t *bytes;
    uint32_t base, size;
    uint32_t refill; /* wait states of a non-sequential fetch */
    struct cortex_m0_operation *operations;
    uint32_t decoded_low, decoded_high; /* offsets; no instruction outside this range has been decoded */
};

struct cortex_m0_systick {
    uint64_t origin; /* cycle at which the counter was `value` */
    uint32_t value, reload;
    bool enabled, interrupt_enabled, processor_clock, count_flag;
};

/* Processor state. The caller owns the struct and may read it between runs. */
struct cortex_m0 {
    uint32_t r[16];                     /* r[13]: the stack pointer in use; r[15]: address of the next instruction */
    uint32_t n, z, c, v;                /* N: bit 31 of n; Z: z is 0; C: c is 1; V: bit 31 of v */
    uint64_t cycle;                     /* cycles since cortex_m0_init(), sleep included */
    uint64_t deadline;                  /* cycle at which the current execution ends */
    uint32_t lowest_sp;                 /* minimum of r[13] for the stack in use */
    uint32_t other_sp, other_lowest_sp; /* PSP while MSP is in use, and vice versa */
    uint32_t progress;                  /* cycles already spent in the register-list instruction at r[15] */
    bool attention;                     /* leave the fast path: an exception, stop or reset may be due */
    bool thumb, primask, process_stack;
    bool asleep, wakes_on_event, event, entering;
    bool locked_up, lockup_reported;
    bool stop_requested, reset_requested, fault_pending;
    bool sleep_on_exit, deep_sleep, event_on_pending;
    uint8_t ipsr;
    uint8_t entry_number;              /* exception whose entry was started */
    int8_t priority;                   /* execution priority: -2 NMI, -1 HardFault, 0 to 3, 4 thread mode */
    uint64_t pending, enabled, active; /* bit n: exception number n */
    uint64_t level[4];                 /* level[p]: bit mask of the exceptions with priority p */
    uint32_t lines;                    /* levels of the interrupt inputs, bit n: interrupt n */
    uint64_t pended_at[CORTEX_M0_EXCEPTIONS];
    uint64_t entry_begin, entry_choice;
    uint32_t entry_return; /* EXC_RETURN value of the current entry */
    uint32_t exit_value;   /* EXC_RETURN value of the current return */
    uint32_t vector_base;
    uint64_t asleep_since, sleep_cycles; /* cycle at which the current sleep began; total cycles asleep */
    struct cortex_m0_systick systick;
    struct cortex_m0_fault fault; /* latest fault */
    uint64_t faults;
    struct cortex_m0_code flash_code, ram_code;
    struct cortex_m0_account *account; /* NULL: no cycle accounting */
    struct cortex_m0_config config;
};

/* Return the timing of a PSoC 4200 at 48 MHz. */
struct cortex_m0_timing cortex_m0_psoc4200(void);

/* Return the timing of a PSoC 4100S at 48 MHz, whose processor is a Cortex-M0+. */
struct cortex_m0_timing cortex_m0_psoc4100s(void);

/* Initialise a processor and allocate the decoded instructions (8 bytes per halfword). Returns 0, or -1 if out of
 * memory or if the configuration is invalid: a size or base address is not a multiple of 4, or the timing is
 * impossible. Call cortex_m0_reset() before the first run. */
int cortex_m0_init(struct cortex_m0 *cpu, const struct cortex_m0_config *config);
void cortex_m0_free(struct cortex_m0 *cpu);

/* Reset and start from the vector table at address `vectors`. ARMv6-M has no VTOR, but chips relocate the table (PSoC:
 * VECS_IN_RAM). The cycle counter keeps counting. */
void cortex_m0_reset(struct cortex_m0 *cpu, uint32_t vectors);
void cortex_m0_set_vectors(struct cortex_m0 *cpu, uint32_t vectors);

/* Execute whole instructions until the cycle counter reaches `until`; while asleep, time passes until then. A started
 * instruction is completed, so up to 3 more cycles may elapse (more with bus stalls or an exception return). */
enum cortex_m0_reason cortex_m0_run(struct cortex_m0 *cpu, uint64_t until);

/* Execute one instruction or one exception entry. Returns CORTEX_M0_DEADLINE, or another reason that ended the step. */
enum cortex_m0_reason cortex_m0_step(struct cortex_m0 *cpu);

/* End a run. From a callback: cortex_m0_run() returns after the current instruction. Between runs: the next run returns
 * at once. */
void cortex_m0_stop(struct cortex_m0 *cpu);

/* Set interrupt inputs, between runs or from a callback. A level persists until it is cleared; a pulse is latched. */
void cortex_m0_set_line(struct cortex_m0 *cpu, unsigned irq, bool high);
void cortex_m0_pulse(struct cortex_m0 *cpu, unsigned irq);
void cortex_m0_pulse_nmi(struct cortex_m0 *cpu);
void cortex_m0_inject_fault(struct cortex_m0 *cpu); /* HardFault, as after an undefined instruction */
void cortex_m0_send_event(struct cortex_m0 *cpu);   /* RXEV, the event that ends WFE */

/* Return the earliest cycle at which SysTick may wake the processor; UINT64_MAX if it never does, or if the processor
 * is awake. */
uint64_t cortex_m0_wake_cycle(const struct cortex_m0 *cpu);

/* Discard decoded instructions in a range of flash or RAM that was written from outside the processor. */
void cortex_m0_memory_changed(struct cortex_m0 *cpu, uint32_t address, uint32_t size);
void cortex_m0_set_flash_wait(struct cortex_m0 *cpu, uint8_t wait);

uint32_t cortex_m0_xpsr(const struct cortex_m0 *cpu);
void cortex_m0_set_xpsr(struct cortex_m0 *cpu, uint32_t xpsr); /* sets the flags and T; IPSR is unchanged */
uint32_t cortex_m0_msp(const struct cortex_m0 *cpu);
uint32_t cortex_m0_psp(const struct cortex_m0 *cpu);
/* Return the minimum of MSP or PSP (high-water mark of the stack) since the reset or the last
 * cortex_m0_reset_stack_marks(), which starts both again. */
uint32_t cortex_m0_lowest_msp(const struct cortex_m0 *cpu);
uint32_t cortex_m0_lowest_psp(const struct cortex_m0 *cpu);
void cortex_m0_reset_stack_marks(struct cortex_m0 *cpu);

/* Start cycle accounting of handlers (NULL: stop). Handlers that are already active are not counted. */
void cortex_m0_set_account(struct cortex_m0 *cpu, struct cortex_m0_account *account);

#endif
