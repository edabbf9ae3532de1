/* What struck, and when: so that every lost frame can be traced to what cost it. The oldest is forgotten first. */
#ifndef EMULATOR_FAULT_LOG_H
#define EMULATOR_FAULT_LOG_H

#include "emulator/faults.h"
#include "emulator/vtime.h"

#define FAULT_LOG_MAX 4096u /* a power of two */

struct fault_strike {
    vtime time;
    uint32_t kind; /* enum fault_kind */
    uint32_t address;
};

struct fault_log {
    uint64_t count; /* since the world began */
    struct fault_strike strikes[FAULT_LOG_MAX];
};

static inline void fault_log_add(struct fault_log *log, vtime time, enum fault_kind kind, uint8_t address)
{
    log->strikes[log->count++ % FAULT_LOG_MAX] = (struct fault_strike){.time = time, .kind = kind, .address = address};
}

#endif
