/* History of the fields on a board's taxels at past records of the stimulus, for as long as the board's delay. */
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

/* Returns NULL if out of memory. */
struct late_history *late_history_open(size_t taxels, double delay_s);
void late_history_free(struct late_history *history);

/* Add a record that ends at `now` and return its fields [taxels], or NULL if out of memory. Discards records that are
 * no longer needed. */
struct taxel_field *late_history_add(struct late_history *history, vtime time, bool is_constant, vtime now);

/* Fields [taxels] before and after a time. `after` is NULL if the next fields are those at `present_time`, which the
 * skin itself holds. At least one record must have been added. */
struct late_span {
    const struct taxel_field *before, *after;
    double fraction;
};

struct late_span late_history_span_at(const struct late_history *history, vtime time, vtime present_time);

#endif
