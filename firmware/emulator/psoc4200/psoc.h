/* A PSoC 4200 (CY8C4245AXI-483) that executes an image: the Cortex-M0 of cortex_m0/, and of the blocks around it what the
 * firmware of boards/psoc4200 uses, in virtual time. What is modelled, register by register: boards/psoc4200/PERIPHERALS.md.
 *
 * A register that nobody has modelled is not silently 0: the access is told on standard error, with address and PC, and the
 * processor stands still from then on. */
#ifndef PSOC4200_PSOC_H
#define PSOC4200_PSOC_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/cortex_m0/cortex_m0.h"
#include "emulator/flash.h"
#include "emulator/psoc4200/blocks.h"
#include "emulator/vtime.h"

#define PSOC_RAM_BASE 0x20000000u
#define PSOC_RAM_SIZE 4096u

/* What a conversion measured: lines as boards/psoc4200/pins.toml counts them, -1 where not exactly one is connected. */
struct psoc_conversion {
    int tx, rx;
    uint32_t period;       /* sample clocks */
    uint32_t sense;        /* sample clocks of one sense clock */
    uint32_t sample;       /* processor clocks of one sample clock */
    uint8_t idac_code;
    vtime begin, end;
};

/* What the pins end in. Times are those of the instruction that did it. */
struct psoc_wires {
    void *context;
    /* The sample clocks in which the current source was on; at the conversion's end. */
    uint16_t (*convert)(void *context, const struct psoc_conversion *conversion);
    /* SCB0 as master: start (again) and address byte, a byte, reading one, stop; psoc_i2c_event() follows. */
    void (*i2c_start)(void *context, uint8_t address_byte, vtime clock, vtime now);
    void (*i2c_write)(void *context, uint8_t byte, vtime now);
    void (*i2c_read)(void *context, vtime now);
    void (*i2c_stop)(void *context, vtime now);
    void (*i2c_abort)(void *context, vtime now);
    void (*i2c_drive)(void *context, bool scl_high, bool sda_high);
    bool (*i2c_scl)(void *context, vtime now);
    bool (*i2c_sda)(void *context, vtime now);
    /* SCB1: a byte waits (psoc_uart_take()); RTS. */
    void (*uart_kick)(void *context, vtime now);
    void (*uart_hold)(void *context, bool hold, vtime now);
};

struct psoc_config {
    const char *name; /* for complaints; at most 15 characters */
    struct flash *flash;
    uint8_t unique_id[8];
    double clock_rate; /* of the main oscillator, times its nominal frequency */
    uint64_t seed;     /* of what is in the RAM after power-up */
    vtime reset_time;  /* from a reset to the first instruction */
    struct psoc_wires wires;
};

struct psoc {
    struct cortex_m0 cpu;
    struct cortex_m0_account account;
    struct psoc_config config;
    char name[16];
    _Alignas(4) uint8_t ram[PSOC_RAM_SIZE];
    struct random_source random;
    struct psoc_clocks clocks;
    struct psoc_cpuss cpuss;
    struct psoc_gpio gpio;
    struct psoc_csd csd;
    struct psoc_srss srss;
    struct psoc_scb scb[2];
    double ps_per_cycle;
    vtime origin;          /* when the cycle counter was at origin_cycle */
    uint64_t origin_cycle;
    vtime stalled_until;
    bool powered;
    bool broken;           /* stands still: an access that nobody has modelled */
    bool acted;            /* on its wires or on its flash, in this run */
    bool answered;         /* what the bus waits for has come */
    bool roused;           /* an interrupt input has changed since the last run */
    uint64_t resets;       /* since power-up or not */
    uint64_t faults_before; /* cpu.faults at the last reset */
};

/* Returns -1 without memory. There is no power yet. */
int psoc_init(struct psoc *psoc, const struct psoc_config *config);
void psoc_free(struct psoc *psoc);

/* `causes`: bits of RES_CAUSE. */
void psoc_power_on(struct psoc *psoc, vtime now, uint32_t causes);
void psoc_power_off(struct psoc *psoc);

/* Execute up to `until`. Returns true if it has stopped before, because it has acted on its wires or on its flash. */
bool psoc_run(struct psoc *psoc, vtime until);
/* The same, until the bus has its answer; false: not within that time. */
bool psoc_run_to_answer(struct psoc *psoc, vtime until);

/* Until then its main program does nothing, as if something else kept it busy; interrupts are served. */
void psoc_stall(struct psoc *psoc, vtime until);

/* How far it has got, and when it next has something to do by itself. */
vtime psoc_now(const struct psoc *psoc);
vtime psoc_next(const struct psoc *psoc);

/* From now on the oscillator runs so fast. */
void psoc_set_clock_rate(struct psoc *psoc, double clock_rate);

/* Whether an application runs: vectors are served from RAM. */
bool psoc_runs_application(const struct psoc *psoc);
/* Whether it has faulted, or locked up, since its last reset. */
bool psoc_has_faulted(const struct psoc *psoc);

/* SCB0 as slave: what the bus asks of it at the end of a byte, to which psoc_run() has got. Each returns when it lets go of the clock. */
bool psoc_i2c_listens(const struct psoc *psoc, uint8_t address);
vtime psoc_i2c_address(struct psoc *psoc, vtime now, bool reading, bool *acknowledge);
vtime psoc_i2c_written(struct psoc *psoc, vtime now, uint8_t byte, bool *acknowledge);
vtime psoc_i2c_read(struct psoc *psoc, vtime now, uint8_t *byte);
void psoc_i2c_stopped(struct psoc *psoc);
void psoc_i2c_bus_error(struct psoc *psoc);

/* SCB0 as master: what has become of its command. */
enum psoc_i2c_event {
    PSOC_I2C_ACK,
    PSOC_I2C_NACK,
    PSOC_I2C_BYTE,
    PSOC_I2C_STOP,
    PSOC_I2C_ARBITRATION_LOST,
    PSOC_I2C_BUS_ERROR,
};
void psoc_i2c_event(struct psoc *psoc, vtime now, enum psoc_i2c_event event, uint8_t byte);

/* SCB1: at the time to which psoc_run() has got. */
void psoc_uart_receive(struct psoc *psoc, uint8_t byte);
bool psoc_uart_take(struct psoc *psoc, uint8_t *byte);

#endif
