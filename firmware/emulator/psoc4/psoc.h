/* Emulated PSoC 4200 (CY8C4245AXI-483 or, as on the original boards, CY8C4244AZI-443) or PSoC 4100S (CY8C4146AXI-S433) that
 * executes an image in virtual time: the processor of cortex_m0/ and the peripheral blocks that the firmware uses.
 * PERIPHERALS.md of boards/psoc4200 and boards/psoc4100s lists the modelled registers.
 *
 * An access to a register that is not modelled never reads as 0: it is reported on standard error with address and PC,
 * and the processor stops. */
#ifndef PSOC4_PSOC_H
#define PSOC4_PSOC_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/cortex_m0/cortex_m0.h"
#include "emulator/base/flash.h"
#include "emulator/psoc4/blocks.h"
#include "emulator/psoc4/deviations.h"
#include "emulator/psoc4/parts.h"
#include "emulator/base/vtime.h"

#define PSOC_RAM_BASE 0x20000000u
#define PSOC_RAM_SIZE_MAX 8192u

/* Parameters of a conversion. tx, rx: row and column of the board (struct psoc_part), -1 unless exactly one line of
 * each kind is connected. */
struct psoc_conversion {
    int tx, rx;
    uint32_t period; /* sample clocks */
    uint32_t sense;  /* sample clocks of one sense clock */
    uint32_t sample; /* processor clocks of one sample clock */
    uint8_t idac_code;
    vtime begin, end;
};

/* Callbacks of the pins. Times are those of the instruction that caused the action. */
struct psoc_wires {
    void *context;
    /* Called at the end of a conversion. Returns the number of sample clocks in which the current source was on. */
    uint16_t (*convert)(void *context, const struct psoc_conversion *conversion);
    /* Serial block of the bus as master: start or repeated start with the address byte, write a byte, read a byte,
     * stop. psoc_i2c_on_event() reports the result. */
    void (*i2c_start)(void *context, uint8_t address_byte, vtime clock, vtime now);
    void (*i2c_write)(void *context, uint8_t byte, vtime now);
    void (*i2c_read)(void *context, vtime now);
    void (*i2c_stop)(void *context, vtime now);
    void (*i2c_abort)(void *context, vtime now);
    void (*i2c_drive)(void *context, bool scl_high, bool sda_high);
    bool (*i2c_scl)(void *context, vtime now);
    bool (*i2c_sda)(void *context, vtime now);
    /* Serial block of the UART: a byte is available (psoc_uart_take()); RTS. */
    void (*uart_kick)(void *context, vtime now);
    void (*uart_hold)(void *context, bool hold, vtime now);
};

struct psoc_config {
    const char *name; /* for messages; at most 15 characters */
    struct flash *flash;
    const struct psoc_part *part; /* NULL: PSOC_PART_STANDARD */
    uint8_t unique_id[8];
    double clock_rate; /* actual divided by nominal frequency of the main oscillator */
    uint64_t seed;     /* of the random RAM contents after power-up */
    vtime reset_time;  /* time from a reset to the first instruction */
    struct psoc_wires wires;
    struct psoc_deviations deviations;
};

struct psoc {
    struct cortex_m0 cpu;
    struct cortex_m0_account account;
    struct psoc_config config;
    char name[16];
    _Alignas(4) uint8_t ram[PSOC_RAM_SIZE_MAX];
    struct random_source random;
    struct psoc_clocks clocks; /* PSoC 4200 */
    struct psoc_peri peri;     /* PSoC 4100S */
    struct psoc_cpuss cpuss;
    struct psoc_gpio gpio;
    struct psoc_csd csd;
    uint32_t csd_words[PSOC_CSD_WORDS]; /* PSoC 4100S: registers of the converter */
    struct psoc_srss srss;
    struct psoc_scb scb[2];
    double ps_per_cycle;
    vtime origin; /* virtual time at cycle origin_cycle */
    uint64_t origin_cycle;
    vtime stalled_until;
    bool powered;
    bool has_stopped;       /* the processor stopped after an access that is not modelled */
    bool has_acted;         /* acted on its wires or its flash in this run */
    bool has_replied;       /* the bus has the reply that it waits for */
    bool input_changed;     /* an interrupt input changed since the last run */
    uint64_t resets;        /* all resets since psoc_init() */
    uint64_t faults_before; /* cpu.faults at the last reset */
};

/* Initialise an unpowered chip. Returns -1 if out of memory. */
int psoc_init(struct psoc *psoc, const struct psoc_config *config);
void psoc_free(struct psoc *psoc);

/* Switch the power. causes: bits of RES_CAUSE. */
void psoc_power_on(struct psoc *psoc, vtime now, uint32_t causes);
void psoc_power_off(struct psoc *psoc);

/* Execute up to `until`. Returns true if the run ended earlier because the program acted on its wires or its flash. */
bool psoc_run(struct psoc *psoc, vtime until);
/* Execute until the bus has its reply. Returns false if there is no reply before `until`. */
bool psoc_run_until_reply(struct psoc *psoc, vtime until);

/* Suspend the main program until a time, as if it were busy; interrupts are served. */
void psoc_stall(struct psoc *psoc, vtime until);

/* Inject a fault: the processor takes a HardFault, or the end of the present conversion causes no interrupt. */
void psoc_inject_hard_fault(struct psoc *psoc);
void psoc_lose_conversion(struct psoc *psoc);

/* Return the virtual time that the chip has reached. */
vtime psoc_now(const struct psoc *psoc);

/* Return the time of the next event of the chip; VTIME_NEVER if there is none. */
vtime psoc_next_event(const struct psoc *psoc);

/* Change the clock rate from now on. */
void psoc_set_clock_rate(struct psoc *psoc, double clock_rate);

/* Return whether an application runs, that is, vectors are read from RAM. */
bool psoc_runs_application(const struct psoc *psoc);
/* Return whether the processor has faulted or locked up since its last reset. */
bool psoc_has_faulted(const struct psoc *psoc);

/* Pass an event at the end of a byte to the serial block of the bus as slave, at the time that psoc_run() has reached.
 * Functions of type vtime return the time at which the slave releases SCL. */
bool psoc_i2c_matches_address(const struct psoc *psoc, uint8_t address);
vtime psoc_i2c_on_address(struct psoc *psoc, vtime now, bool reading, bool *acknowledge);
vtime psoc_i2c_on_write(struct psoc *psoc, vtime now, uint8_t byte, bool *acknowledge);
vtime psoc_i2c_on_read(struct psoc *psoc, vtime now, uint8_t *byte);
void psoc_i2c_on_stop(struct psoc *psoc);
void psoc_i2c_on_bus_error(struct psoc *psoc);

/* Serial block of the bus as master: result of its command. */
enum psoc_i2c_event {
    PSOC_I2C_ACK,
    PSOC_I2C_NACK,
    PSOC_I2C_BYTE,
    PSOC_I2C_STOP,
    PSOC_I2C_ARBITRATION_LOST,
    PSOC_I2C_BUS_ERROR,
};
void psoc_i2c_on_event(struct psoc *psoc, vtime now, enum psoc_i2c_event event, uint8_t byte);

/* Serial block of the UART: receive a byte, or take the next byte to transmit, at the time that psoc_run() reached.
 * psoc_uart_take() returns false if there is no byte. */
void psoc_uart_receive(struct psoc *psoc, uint8_t byte);
bool psoc_uart_take(struct psoc *psoc, uint8_t *byte);

#endif
