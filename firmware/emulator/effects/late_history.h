/* History of the fields on a board's taxels (relative rise of the capacitance, gap and force) at past records of the
 * stimulus, for at least as long as the board's delay (effect `late`). */
#ifndef EMULATOR_EFFECTS_LATE_HISTORY_H
#define EMULATOR_EFFECTS_LATE_HISTORY_H

#include <stdbool.h>
#include <stddef.h>

#include "emulator/geometry/taxel_field.h"
#include "emulator/base/vtime.h"

struct late_record {
    vtime time;
    bool is_constant; /* constant until the next record, without interpolation */
};

struct late_history {
    size_t taxels;
    vtime delay;
    struct late_record *records; /* [capacity], used from index `first` on, in order of time */
    struct taxel_field *fields;  /* [capacity][taxels] */
    size_t first, count, capacity;
};

/* Create an empty history for `taxels` taxels that reaches back `delay_s` seconds. Returns NULL if out of memory. */
struct late_history *late_history_open(size_t taxels, double delay_s);
void late_history_free(struct late_history *history);

/* Add a record for the fields from `time` on, and return its fields [taxels], which the caller fills in; NULL if out of
 * memory. Discards records that are no longer needed for conversions at `now` or later. */
struct taxel_field *late_history_add(struct late_history *history, vtime time, bool is_constant, vtime now);

/* Fields [taxels] before and after a time. `after` is NULL if the next fields are those at `present_time`, which the
 * skin itself holds. At least one record must have been added. */
struct late_span {
    const struct taxel_field *before, *after;
    double fraction;
};

struct late_span late_history_span_at(const struct late_history *history, vtime time, vtime present_time);

#endif
