/* A world inside the caller's process, advanced by the caller: C interface of the library of the virtual test rig
 * (host/taxel/link/virtual).
 *
 * Times are picoseconds since the world started (vtime.h). Nothing happens between two calls.
 *
 * Integration:
 *
 *     struct taxel_bench *bench = taxel_bench_open("world.txt", "memory", 0);
 *     taxel_bench_set_stimulus(bench, forces);             // newtons, one value per taxel
 *     taxel_bench_send(bench, command, sizeof command);    // bytes from the host to the hub
 *     taxel_bench_run(bench, 100000000000u);               // up to 0.1 s
 *     size = taxel_bench_receive(bench, bytes, sizeof bytes);
 *     taxel_bench_close(bench);
 */
#ifndef EMULATOR_BENCH_H
#define EMULATOR_BENCH_H

#include <stddef.h>
#include <stdint.h>

#include "emulator/base/fault_log.h"

struct taxel_bench;

enum taxel_bench_error {
    TAXEL_BENCH_UNKNOWN_FAULT = -1,
    TAXEL_BENCH_NO_SUCH_BOARD = -2,
    TAXEL_BENCH_TOO_MANY_FAULTS = -3,
    TAXEL_BENCH_NO_SUCH_BRANCH = -4, /* the board belongs to no branch, or the fault has no such line */
};

/* Open a world. uart: the host's end of the UART: memory, pty or none. counts: the stimulus consists of raw counts,
 * otherwise of newtons. Returns NULL after an error line on stderr. */
struct taxel_bench *taxel_bench_open(const char *world_path, const char *uart, int counts);
void taxel_bench_close(struct taxel_bench *bench);
const char *taxel_bench_pty_name(const struct taxel_bench *bench);
size_t taxel_bench_taxel_count(const struct taxel_bench *bench);

uint64_t taxel_bench_now(const struct taxel_bench *bench);

/* Advance the world. Returns 0, or -1 after an error line on stderr. */
int taxel_bench_run(struct taxel_bench *bench, uint64_t until);

/* Send bytes from the host to the hub. Returns the number of bytes for which the buffer had space. With a
 * pseudo-terminal, the client of the terminal sends the bytes instead. */
size_t taxel_bench_send(struct taxel_bench *bench, const uint8_t *bytes, size_t size);

/* Read bytes that the host has received (uart `memory` only). Returns their number. */
size_t taxel_bench_receive(struct taxel_bench *bench, uint8_t *bytes, size_t size);

/* Return the total number of bytes that the USB adapter has delivered to the host. */
uint64_t taxel_bench_bytes_delivered(const struct taxel_bench *bench);

/* Return whether the hub stops the adapter by RTS before its receive ring is full (flow_control of the world). */
int taxel_bench_has_flow_control(const struct taxel_bench *bench);

/* Set the force or raw count of each taxel from now on, in the order of the world's boards. Returns 0, or -1 after an
 * error line. */
int taxel_bench_set_stimulus(struct taxel_bench *bench, const float *values);

/* Inject a fault that README.md describes. Returns 0 or enum taxel_bench_error. */
int taxel_bench_inject_fault(struct taxel_bench *bench, const char *name, uint8_t address, double value,
                             double second_value);

/* Execute a transfer by the I2C adapter of the test rig. Advances the world until the transfer has ended, by `timeout`
 * at most. Returns enum taxel_i2c_result. */
int taxel_bench_transfer_i2c(struct taxel_bench *bench, uint8_t address, const uint8_t *write_bytes, size_t write_size,
                             uint8_t *read_bytes, size_t read_size, uint64_t timeout);

/* Free a bus whose SDA a board holds low, as the driver of an adapter does (i2c_generic_scl_recovery of Linux): up to
 * nine clocks at 100 kHz, then a stop condition. Advances the world. Does nothing while a board holds SCL low. */
void taxel_bench_recover_bus(struct taxel_bench *bench);

/* Copy entries of the fault log, starting at number `first`. Returns how many were copied. *lost becomes the number of
 * entries from `first` on that the log no longer contains. */
size_t taxel_bench_read_fault_log(const struct taxel_bench *bench, uint64_t first, struct fault_log_entry *entries,
                                  size_t size, uint64_t *lost);

/* Return the flash of a board, or of the hub (address 0): its 256 rows of 128 bytes; the number of writes of each row;
 * and the number of writes that a power cut has torn. address: as in the world file, also after the board was
 * configured with another address. The results are NULL and 0 if there is no such board. */
uint32_t taxel_bench_flash_size(const struct taxel_bench *bench, uint8_t address);
const uint8_t *taxel_bench_flash_bytes(const struct taxel_bench *bench, uint8_t address);
const uint32_t *taxel_bench_flash_wear(const struct taxel_bench *bench, uint8_t address);
uint64_t taxel_bench_torn_writes(const struct taxel_bench *bench, uint8_t address);

/* Return which program a board, or the hub (address 0), runs: 0 an application, 1 the bootloader, 2 an image that does
 * not respond; -1 if there is no such board. */
int taxel_bench_running_program(const struct taxel_bench *bench, uint8_t address);

/* Counters of an executed processor (psoc4/) since its first power-up. */
struct taxel_bench_processor {
    uint64_t resets;
    uint64_t cycles, slept;
    uint64_t faults;
    uint32_t fault_kind; /* enum cortex_m0_fault_kind, of the latest fault */
    uint32_t fault_pc, fault_address;
    uint32_t lowest_stack; /* lowest value of the stack pointer */
    uint32_t pc;
    uint32_t broken; /* the processor stopped at an access to a register that is not modelled (a line on stderr) */
    uint32_t asleep;
    uint32_t is_application;
    uint32_t ram_end;                     /* address behind the RAM, where the stack begins */
    uint32_t irq_scb0, irq_scb1, irq_csd; /* interrupt numbers */
};

/* Cycles of the handler of one exception. count: calls. own: cycles without those of exceptions that preempted the
 * handler (sum, minimum, maximum). inclusive: cycles with them (sum, maximum). latency: cycles from pending to the
 * first cycle of the entry (sum, maximum). */
struct taxel_bench_cost {
    uint64_t count, own, own_min, own_max, inclusive, inclusive_max, latency, latency_max;
};

/* Read the counters of the processor of a board, or of the hub (address 0); or the cycles of one of its exception
 * handlers. Both return 0, or TAXEL_BENCH_NO_SUCH_BOARD where no image is executed. */
int taxel_bench_read_processor(struct taxel_bench *bench, uint8_t address, struct taxel_bench_processor *processor);
int taxel_bench_read_handler_cost(struct taxel_bench *bench, uint8_t address, unsigned exception,
                                  struct taxel_bench_cost *cost);

/* Plan a power cut of a board or of the hub (address 0): `delay` after the start of a flash write, for `off_time`.
 * Write number 1 is the next write, or the next one after the cuts that are planned already. Returns 0 or enum
 * taxel_bench_error. */
int taxel_bench_plan_power_cut(struct taxel_bench *bench, uint8_t address, uint64_t write_number, uint64_t delay,
                               uint64_t off_time);

/* Return the number of planned power cuts that took place; 0 for an unknown address. */
uint64_t taxel_bench_power_cut_count(const struct taxel_bench *bench, uint8_t address);

/* Read one of the latest eight power cuts (numbered from 0): its row, its delay after the start of the write, and the
 * 128 bytes that were to be written. Returns 0, or TAXEL_BENCH_NO_SUCH_BOARD if there is no such record. */
int taxel_bench_read_power_cut(const struct taxel_bench *bench, uint8_t address, uint64_t number, uint16_t *row,
                               uint64_t *delay, uint8_t *new_bytes);

/* Write the counters of the run as a JSON file. Returns 0, or -1 after an error line on stderr. */
int taxel_bench_write_statistics(const struct taxel_bench *bench, const char *path);

#endif
