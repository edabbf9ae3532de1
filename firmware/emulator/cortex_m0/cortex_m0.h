/* An ARMv6-M processor, the Cortex-M0, that executes Thumb images as shipped: real exceptions, NVIC, SysTick and faults, and
 * the cycle counts of its manual (ARM DDI 0432C, table 3-1).
 *
 * Flash and RAM are memory of the caller and read directly; everything else goes through two functions of the caller. The
 * caller says up to which cycle the processor runs. Nothing here is shared: a process may hold as many processors as it
 * likes, each used by one thread at a time. */
#ifndef CORTEX_M0_H
#define CORTEX_M0_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CORTEX_M0_IRQS 32u
#define CORTEX_M0_EXCEPTIONS 48u /* exception numbers; interrupt n is 16 + n */

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

/* Why cortex_m0_run() has returned. */
enum cortex_m0_reason {
    CORTEX_M0_TIME,          /* the cycle has come */
    CORTEX_M0_SLEEPS,        /* the cycle has come, and the processor is in WFI or WFE */
    CORTEX_M0_STOPPED,       /* cortex_m0_stop() was called; the instruction under way has been completed */
    CORTEX_M0_WAITS,         /* an access was answered with CORTEX_M0_LATER; its instruction has not been executed */
    CORTEX_M0_BREAKPOINT,    /* at a BKPT, which has not been executed (halt_on_breakpoint) */
    CORTEX_M0_FAULTED,       /* at an instruction that faults; HardFault is entered by the next run (halt_on_fault) */
    CORTEX_M0_RESET_WANTED,  /* AIRCR.SYSRESETREQ was written */
    CORTEX_M0_LOCKUP,        /* a fault in HardFault or NMI, at once; in later runs time passes. Only cortex_m0_reset() ends it */
};

enum cortex_m0_answer {
    CORTEX_M0_OK,
    CORTEX_M0_ERROR, /* nothing there: HardFault */
    CORTEX_M0_LATER, /* nothing has been done; run() returns, and the access is repeated by the next one. Not to an access of
                      * a register list but its first, and not to one that stacks: those take it for an error */
};

/* One access to something that is neither flash nor RAM. */
struct cortex_m0_access {
    uint64_t cycle;   /* in which the data are on the bus */
    uint32_t address; /* a multiple of size */
    uint32_t value;   /* written, or to be filled in; the upper bits are ignored */
    uint32_t stall;   /* to be filled in: wait states, cycles */
    uint8_t size;     /* bytes: 1, 2 or 4 */
};

typedef enum cortex_m0_answer cortex_m0_access_function(void *context, struct cortex_m0_access *access);

/* What the processor's time depends on. The default values are those of a PSoC 4200 at 48 MHz; those that no public document
 * gives are marked (confirm). */
struct cortex_m0_timing {
    uint8_t multiply;          /* of MULS: 1 (PSoC 4200: single-cycle multiplier, data sheet 001-87197) or 32 */
    uint8_t flash_wait;        /* see README.md: 1 above 24 MHz, else 0 (data sheet 001-87197; confirm) */
    uint8_t exception_entry;   /* 16: DDI 0432C, "interrupt latency", memory without wait states */
    uint8_t exception_return;  /* 12: as POP of 8 registers with PC, which moves the same words (confirm) */
    uint8_t tail_chain;        /* 6: as documented for Cortex-M3, DDI 0337; nothing is published for M0 (confirm) */
    uint8_t late_arrival;      /* cycles after which a better exception comes too late for this entry: 12 (confirm) */
};

struct cortex_m0_config {
    const uint8_t *flash; /* readable and executable; the caller may change it: cortex_m0_changed() */
    uint32_t flash_base, flash_size;
    uint8_t *ram;
    uint32_t ram_base, ram_size; /* sizes are multiples of 4 */
    void *context;
    cortex_m0_access_function *read, *write; /* stores to flash come here too. NULL: there is nothing, every access faults */
    struct cortex_m0_timing timing;
    uint32_t systick_reference; /* cycles of one tick of SysTick's other clock; 0: it has none */
    uint32_t systick_calibration; /* SYST_CALIB */
    bool halt_on_breakpoint;    /* without a debugger, a BKPT is a HardFault */
    bool halt_on_fault;
};

enum cortex_m0_fault_kind {
    CORTEX_M0_FAULT_NONE,
    CORTEX_M0_FAULT_UNDEFINED,    /* or unpredictable */
    CORTEX_M0_FAULT_UNALIGNED,
    CORTEX_M0_FAULT_BUS,          /* data: nothing at that address, or a store to flash */
    CORTEX_M0_FAULT_FETCH,        /* an instruction: nothing executable at that address */
    CORTEX_M0_FAULT_STATE,        /* a branch to an even address: Thumb state left */
    CORTEX_M0_FAULT_BREAKPOINT,
    CORTEX_M0_FAULT_SVC,          /* where its priority does not allow it */
    CORTEX_M0_FAULT_RETURN,       /* an EXC_RETURN that does not fit the state */
    CORTEX_M0_FAULT_STACKING,     /* of an exception's frame */
    CORTEX_M0_FAULT_VECTOR,       /* nothing readable at the vector's address */
};

struct cortex_m0_fault {
    enum cortex_m0_fault_kind kind;
    uint32_t pc;
    uint32_t address; /* of the data, the branch's target or the vector */
    uint64_t cycle;
};

/* Cycles of one exception's handler, from the first cycle of its entry to the last of its return. */
struct cortex_m0_cost {
    uint64_t count;
    uint64_t own, own_min, own_max;                   /* without exceptions that preempted it */
    uint64_t inclusive, inclusive_min, inclusive_max; /* with them */
    uint64_t latency, latency_max;                    /* from becoming pending to the first cycle of the entry */
};

struct cortex_m0_account {
    struct cortex_m0_cost cost[CORTEX_M0_EXCEPTIONS];
    struct {
        uint64_t begin, inner;
        uint8_t number;
    } open[CORTEX_M0_EXCEPTIONS];
    unsigned depth;
    unsigned depth_max; /* exceptions nested */
};

struct cortex_m0_operation; /* an instruction, decoded */

/* Executable memory and its decoded instructions. */
struct cortex_m0_code {
    const uint8_t *bytes;
    uint32_t base, size;
    uint32_t refill; /* wait states of a fetch that does not follow the one before */
    struct cortex_m0_operation *operations;
    uint32_t low, high; /* offsets: nothing outside has been decoded */
};

struct cortex_m0_systick {
    uint64_t origin; /* the cycle at which `value` was the counter's */
    uint32_t value, reload;
    bool enabled, interrupts, processor_clock, counted;
};

/* The caller owns it, and may read it between runs. */
struct cortex_m0 {
    uint32_t r[16];        /* r[13]: the stack pointer in use; r[15]: address of the next instruction */
    uint32_t n, z, c, v;   /* N: bit 31 of n; Z: z is 0; C: c is 1; V: bit 31 of v */
    uint64_t cycle;        /* since the beginning, also while asleep */
    uint64_t deadline;     /* of the instructions under way */
    uint32_t lowest_sp;    /* of the stack in use, ever */
    uint32_t other_sp, other_lowest_sp; /* PSP while MSP is in use, and the other way round */
    uint32_t progress;     /* cycles that have gone by in the register list instruction at r[15] */
    bool attention;        /* something else than the next instruction may be due */
    bool thumb, primask, process_stack;
    bool asleep, wakes_by_event, event, entering;
    bool locked_up, lockup_told;
    bool stop_wanted, reset_wanted, fault_waits;
    bool sleep_on_exit, deep_sleep, event_on_pend;
    uint8_t ipsr;
    uint8_t entry_number;  /* for which the entry under way was begun */
    int8_t priority;       /* of execution: -2 NMI, -1 HardFault, 0 to 3, 4 thread */
    uint64_t pending, enabled, active; /* bit: exception number */
    uint64_t level[4];     /* exceptions of that priority */
    uint32_t lines;        /* levels of the interrupt inputs */
    uint64_t pended_at[CORTEX_M0_EXCEPTIONS];
    uint64_t entry_begin, entry_choice;
    uint32_t entry_return; /* EXC_RETURN of the entry under way */
    uint32_t exit_value;   /* EXC_RETURN of the return under way */
    uint32_t vector_base;
    uint64_t asleep_since, slept; /* cycle; cycles in all */
    struct cortex_m0_systick systick;
    struct cortex_m0_fault fault; /* the latest */
    uint64_t faults;
    struct cortex_m0_code flash_code, ram_code;
    struct cortex_m0_account *account; /* NULL: nobody wants to know */
    struct cortex_m0_config config;
};

/* Timing of a PSoC 4200 at 48 MHz. */
struct cortex_m0_timing cortex_m0_psoc4200(void);

/* Memory for decoded instructions: 8 bytes a halfword. Returns -1 without it, or if a size or address is not a multiple of 4.
 * The processor is not reset yet. */
int cortex_m0_init(struct cortex_m0 *cpu, const struct cortex_m0_config *config);
void cortex_m0_free(struct cortex_m0 *cpu);

/* Begin at the vector table there; VTOR does not exist on this processor, but chips move the table (PSoC: VECS_IN_RAM).
 * The cycle counter goes on. */
void cortex_m0_reset(struct cortex_m0 *cpu, uint32_t vectors);
void cortex_m0_set_vectors(struct cortex_m0 *cpu, uint32_t vectors);

/* Execute whole instructions until the cycle counter has reached `until`; asleep, time passes until then. Instructions that
 * have begun are completed, so that up to 3 cycles more may have gone by (a stall, an exception's return: more). */
enum cortex_m0_reason cortex_m0_run(struct cortex_m0 *cpu, uint64_t until);

/* One instruction, or the entry of an exception. */
enum cortex_m0_reason cortex_m0_step(struct cortex_m0 *cpu);

/* From a callback: return when this instruction is done. Between runs: the next one returns at once. */
void cortex_m0_stop(struct cortex_m0 *cpu);

/* Interrupt inputs, between runs or from a callback. A level stays until it is taken away; a pulse is latched. */
void cortex_m0_set_line(struct cortex_m0 *cpu, unsigned irq, bool high);
void cortex_m0_pulse(struct cortex_m0 *cpu, unsigned irq);
void cortex_m0_pulse_nmi(struct cortex_m0 *cpu);
void cortex_m0_send_event(struct cortex_m0 *cpu); /* RXEV: what WFE waits for */

/* The earliest cycle at which the processor may wake by itself (SysTick); UINT64_MAX: never, or it is awake. */
uint64_t cortex_m0_wakes_at(const struct cortex_m0 *cpu);

/* Somebody else than this processor has written flash or RAM. */
void cortex_m0_changed(struct cortex_m0 *cpu, uint32_t address, uint32_t size);
void cortex_m0_set_flash_wait(struct cortex_m0 *cpu, uint8_t wait);

uint32_t cortex_m0_xpsr(const struct cortex_m0 *cpu);
void cortex_m0_set_xpsr(struct cortex_m0 *cpu, uint32_t xpsr); /* flags and T; IPSR stays */
uint32_t cortex_m0_msp(const struct cortex_m0 *cpu);
uint32_t cortex_m0_psp(const struct cortex_m0 *cpu);
/* High-water marks: the lowest values ever of MSP and PSP, since the reset or cortex_m0_forget_stack(). */
uint32_t cortex_m0_lowest_msp(const struct cortex_m0 *cpu);
uint32_t cortex_m0_lowest_psp(const struct cortex_m0 *cpu);
void cortex_m0_forget_stack(struct cortex_m0 *cpu);

/* Begin to account for handlers (NULL: end). What runs already is not counted. */
void cortex_m0_set_account(struct cortex_m0 *cpu, struct cortex_m0_account *account);

#endif
