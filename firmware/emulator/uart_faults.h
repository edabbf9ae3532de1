/* Faults of one direction of the UART: bytes that arrive changed, not at all, twice or late. */
#ifndef EMULATOR_UART_FAULTS_H
#define EMULATOR_UART_FAULTS_H

#include "emulator/base/fault_log.h"

#define UART_FAULTS_MAX 64u

struct uart_faults {
    uint64_t position; /* bytes transmitted so far */
    vtime held_until;  /* no byte arrives before */
    size_t count;
    struct {
        enum fault_kind kind;
        uint64_t from, until; /* affected positions: from <= position < until */
        uint8_t flip;         /* inverted bits */
    } pending[UART_FAULTS_MAX];
};

/* Schedule a fault. Its `value` is the number of bytes that pass before it takes effect; `second_value` is the bit
 * (flip) or the number of affected bytes (up_drop, up_double and their down_ counterparts; 0 is treated as 1). The
 * `value` of a delay is in milliseconds, and the delay starts at `now`. Returns false if UART_FAULTS_MAX faults are
 * pending. */
bool uart_faults_add(struct uart_faults *line, const struct fault_description *fault, vtime now);

/* Transmit one byte: write the 0, 1 or 2 bytes that arrive to `out`. Returns their number. */
size_t uart_faults_apply(struct uart_faults *line, uint8_t byte, uint8_t out[2], vtime now, struct fault_log *log);

#endif
