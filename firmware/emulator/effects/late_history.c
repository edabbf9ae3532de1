#include "emulator/effects/late_history.h"

#include <stdlib.h>
#include <string.h>

#define FIRST_CAPACITY 64u

/* Create an empty history of the fields of `taxels` taxels that reaches back at least `delay_s` seconds. Returns NULL
 * if out of memory. */
struct late_history *late_history_open(size_t taxels, double delay_s)
{
    struct late_history *history = calloc(1, sizeof *history);
    if (history) {
        history->taxels = taxels;
        history->delay = (vtime)(delay_s * (double)VTIME_SECOND);
    }
    return history;
}

/* Free the recorded fields of a board. NULL is permitted. */
void late_history_free(struct late_history *history)
{
    if (history) {
        free(history->records);
        free(history->fields);
        free(history);
    }
}

/* Reserve memory for one more record behind the last: move the records to the start of the array if discarded records
 * left space there, otherwise double the capacity. Returns false if out of memory. */
static bool reserve_record(struct late_history *history)
{
    const size_t taxels = history->taxels;
    if (history->first && history->first + history->count == history->capacity) {
        memmove(history->records, history->records + history->first, history->count * sizeof *history->records);
        memmove(history->fields, history->fields + history->first * taxels,
                history->count * taxels * sizeof *history->fields);
        history->first = 0;
    }
    if (history->count < history->capacity) {
        return true;
    }
    const size_t capacity = history->capacity ? 2u * history->capacity : FIRST_CAPACITY;
    struct late_record *records = realloc(history->records, capacity * sizeof *records);
    history->records = records ? records : history->records;
    struct taxel_field *fields = realloc(history->fields, capacity * taxels * sizeof *fields);
    history->fields = fields ? fields : history->fields;
    if (!records || !fields) {
        return false;
    }
    history->capacity = capacity;
    return true;
}

/* Append a record for the fields from `time` on and return them [taxels] for the caller to fill in; NULL if out of
 * memory. is_constant: the fields do not change until the next record. Discards records that are older than the delay
 * before `now`. */
struct taxel_field *late_history_add(struct late_history *history, vtime time, bool is_constant, vtime now)
{
    /* A conversion uses the field at its middle, slightly before `now`: keep records for longer than the delay. */
    const vtime needed = history->delay + VTIME_SECOND / 10u;
    while (history->count > 1u && history->records[history->first + 1u].time + needed < now) {
        history->first++;
        history->count--;
    }
    if (!reserve_record(history)) {
        return NULL;
    }
    const size_t at = history->first + history->count++;
    history->records[at] = (struct late_record){.time = time, .is_constant = is_constant};
    return history->fields + at * history->taxels;
}

/* Find the records before and after a past `time` by bisection, and the fraction for interpolation between them. After
 * the last record, the fields change linearly to the present fields at `present_time`, which the caller has: `after` is
 * then NULL. */
struct late_span late_history_span_at(const struct late_history *history, vtime time, vtime present_time)
{
    const struct late_record *records = history->records + history->first;
    size_t low = 0, high = history->count;
    while (high - low > 1u) {
        const size_t middle = (low + high) / 2u;
        if (records[middle].time <= time) {
            low = middle;
        } else {
            high = middle;
        }
    }
    const bool is_last = low + 1u == history->count;
    const vtime end = is_last ? present_time : records[low + 1u].time;
    struct late_span span = {.before = history->fields + (history->first + low) * history->taxels};
    span.after = is_last ? NULL : span.before + history->taxels;
    if (!records[low].is_constant && time > records[low].time && end > records[low].time) {
        span.fraction = (double)(time - records[low].time) / (double)(end - records[low].time);
    }
    return span;
}
