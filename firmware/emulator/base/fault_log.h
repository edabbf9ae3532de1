/* The faults that took effect, with their times: each lost frame can be traced to a fault. The log keeps the latest
 * FAULT_LOG_MAX entries. */
#ifndef EMULATOR_BASE_FAULT_LOG_H
#define EMULATOR_BASE_FAULT_LOG_H

#include "emulator/base/faults.h"
#include "emulator/base/vtime.h"

#define FAULT_LOG_MAX 4096u /* a power of two */

struct fault_log_entry {
    vtime time;
    uint32_t kind; /* enum fault_kind */
    uint32_t address;
};

struct fault_log {
    uint64_t count; /* entries added since the world started */
    struct fault_log_entry entries[FAULT_LOG_MAX];
};

/* Add an entry to the log; it replaces the oldest entry if the log is full. */
static inline void fault_log_add(struct fault_log *log, vtime time, enum fault_kind kind, uint8_t address)
{
    log->entries[log->count++ % FAULT_LOG_MAX] =
        (struct fault_log_entry){.time = time, .kind = kind, .address = address};
}

#endif
