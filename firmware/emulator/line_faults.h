/* What a UART line does to the bytes on it: some are changed, lost, doubled or late. One struct a direction. */
#ifndef EMULATOR_LINE_FAULTS_H
#define EMULATOR_LINE_FAULTS_H

#include "emulator/fault_log.h"

#define LINE_FAULTS_MAX 64u

struct line_faults {
    uint64_t position; /* bytes that have passed */
    vtime held_until;
    size_t count;
    struct {
        enum fault_kind kind;
        uint64_t from, until; /* positions */
        uint8_t flip;
    } waiting[LINE_FAULTS_MAX];
};

/* `value`: how many bytes pass first, and `second`: a bit (flip) or how many bytes (drop, double; 0 counts as 1). A delay
 * takes milliseconds as its `value` and begins now. Returns false when too many wait already. */
bool line_faults_add(struct line_faults *line, const struct fault_description *fault, vtime now);

/* Pass a byte; writes up to 2 into `out` and returns how many. */
size_t line_faults_pass(struct line_faults *line, uint8_t byte, uint8_t out[2], vtime now, struct fault_log *log);

#endif
