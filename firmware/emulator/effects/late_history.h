/* What acted on a board's taxels at past records of the stimulus, as far back as the board is late. */
#ifndef EMULATOR_EFFECTS_LATE_HISTORY_H
#define EMULATOR_EFFECTS_LATE_HISTORY_H

#include "emulator/skin/skin.h"

struct late_record {
    vtime time;
    bool holds; /* until the next record, without interpolation */
};

struct late_history {
    size_t taxels;
    vtime delay;
    struct late_record *records; /* [capacity], in use from `first` on, in order of time */
    struct taxel_field *fields;  /* [capacity][taxels] */
    size_t first, count, capacity;
};

/* NULL without memory. */
struct late_history *late_history_open(size_t taxels, double delay_s);
void late_history_free(struct late_history *history);

/* Room for the fields [taxels] of a record that is over at `now`, or NULL without memory. Drops what nobody needs any more. */
struct taxel_field *late_history_add(struct late_history *history, vtime time, bool holds, vtime now);

/* Fields [taxels] around a time before `present_time`, from which on the skin itself knows them. `after` is NULL where those
 * of `present_time` are meant. At least one record has been added. */
struct late_span {
    const struct taxel_field *before, *after;
    double fraction;
};

struct late_span late_history_find(const struct late_history *history, vtime time, vtime present_time);

#endif
