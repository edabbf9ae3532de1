/* A world inside a caller's process, moved on by the caller: what a virtual test rig stands on.
 *
 * Times are picoseconds since the world began. Nothing happens between two calls. */
#ifndef EMULATOR_BENCH_H
#define EMULATOR_BENCH_H

#include <stddef.h>
#include <stdint.h>

#include "emulator/fault_log.h"

struct taxel_bench;

enum taxel_bench_refusal {
    TAXEL_BENCH_UNKNOWN_FAULT = -1,
    TAXEL_BENCH_NO_SUCH_BOARD = -2,
    TAXEL_BENCH_TOO_MANY_FAULTS = -3,
};

/* `uart`: where the hub's UART ends: memory, pty or none. `counts`: taxel_bench_press() gives raw counts, not newtons.
 * NULL after a line on stderr. */
struct taxel_bench *taxel_bench_open(const char *world_path, const char *uart, int counts);
void taxel_bench_close(struct taxel_bench *bench);
const char *taxel_bench_pty(const struct taxel_bench *bench);
size_t taxel_bench_taxels(const struct taxel_bench *bench);

uint64_t taxel_bench_now(const struct taxel_bench *bench);
int taxel_bench_run(struct taxel_bench *bench, uint64_t until);

/* Bytes from the host; how many were taken. With a pseudo-terminal they come from there. */
size_t taxel_bench_send(struct taxel_bench *bench, const uint8_t *bytes, size_t size);
size_t taxel_bench_receive(struct taxel_bench *bench, uint8_t *bytes, size_t size);
/* Bytes that the USB adapter has handed to the host so far. */
uint64_t taxel_bench_delivered(const struct taxel_bench *bench);

/* Whether the hub makes the adapter wait before its receive ring is full (the world's flow_control). */
int taxel_bench_holds_back(const struct taxel_bench *bench);

/* What acts on the taxels from now on, one value each, in the order of the world's boards. */
int taxel_bench_press(struct taxel_bench *bench, const float *values);

/* Returns 0 or enum taxel_bench_refusal. */
int taxel_bench_inject(struct taxel_bench *bench, const char *name, uint8_t address, double value, double second);

/* A transfer by the bench's own I2C adapter; the world goes on until it has ended, or for `patience` at most. Returns enum
 * taxel_i2c_result. */
int taxel_bench_transfer(struct taxel_bench *bench, uint8_t address, const uint8_t *write_bytes, size_t write_size,
                         uint8_t *read_bytes, size_t read_size, uint64_t patience);

/* What has struck, from number `first` on; how many were written. `lost`: forgotten ones among them. */
size_t taxel_bench_strikes(const struct taxel_bench *bench, uint64_t first, struct fault_strike *strikes, size_t size,
                           uint64_t *lost);

/* The flash of a board, or of the hub (address 0): 256 rows of 128 bytes, how often each was written, and how many writes the
 * power has torn. `address` is that of the world file, whatever the board has been given since. NULL for a board that is not
 * there. */
const uint8_t *taxel_bench_flash(const struct taxel_bench *bench, uint8_t address);
const uint32_t *taxel_bench_wear(const struct taxel_bench *bench, uint8_t address);
uint64_t taxel_bench_torn(const struct taxel_bench *bench, uint8_t address);
/* 0: an application runs, 1: the bootloader, 2: an image that does not answer; -1: no such board. */
int taxel_bench_runs(const struct taxel_bench *bench, uint8_t address);

/* An executed processor (psoc4200/), since the first power-up. */
struct taxel_bench_processor {
    uint64_t resets;
    uint64_t cycles, slept;
    uint64_t faults;
    uint32_t fault_kind; /* enum cortex_m0_fault_kind, of the latest */
    uint32_t fault_pc, fault_address;
    uint32_t lowest_stack; /* the lowest value of the stack pointer */
    uint32_t pc;
    uint32_t broken; /* it stands still: it asked for what nobody has modelled (a line on standard error) */
    uint32_t asleep;
    uint32_t is_application;
};

/* Cycles of one exception's handler: calls; without what preempted it: sum, least, most; with it: sum, most; to its first cycle: sum,
 * most. */
struct taxel_bench_cost {
    uint64_t count, own, own_min, own_max, inclusive, inclusive_max, latency, latency_max;
};

/* Of a board, or of the hub (address 0). Return 0, or TAXEL_BENCH_NO_SUCH_BOARD where no image is executed. */
int taxel_bench_processor(struct taxel_bench *bench, uint8_t address, struct taxel_bench_processor *processor);
int taxel_bench_cost(struct taxel_bench *bench, uint8_t address, unsigned exception, struct taxel_bench_cost *cost);

/* Cut the power of a board or the hub `after` the beginning of a write to its flash, for `off`. The next write has number 1; if
 * cuts wait already, it is the next after the last of them. Returns 0 or enum taxel_bench_refusal. */
int taxel_bench_plan_cut(struct taxel_bench *bench, uint8_t address, uint64_t operation, uint64_t after, uint64_t off);
/* How many such cuts have been made, and what number `number` of them (from 0 on; of the last eight) has struck: the row, how
 * long after the write's beginning, and the 128 bytes that were to be written. */
uint64_t taxel_bench_cuts(const struct taxel_bench *bench, uint8_t address);
int taxel_bench_cut(const struct taxel_bench *bench, uint8_t address, uint64_t number, uint16_t *row, uint64_t *after,
                    uint8_t *wanted);
int taxel_bench_statistics(const struct taxel_bench *bench, const char *path);

#endif
