#include "emulator/skin/stimulus.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define HEADER_SIZE 24u

/* Read a little-endian 32-bit number from 4 bytes. */
static uint32_t get_u32(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

/* Print an error message with the name of the stimulus and the number of records read so far to stderr. Returns
 * -1. */
static int report_error(const struct stimulus *stimulus, const char *message)
{
    fprintf(stderr, "stimulus %s, after %llu records: %s\n", stimulus->name, (unsigned long long)stimulus->record_count,
            message);
    return -1;
}

/* Read `size` bytes, blocking. Returns the number of bytes read, which is less than `size` only at the end of the
 * stream. */
static size_t read_fully(int fd, uint8_t *bytes, size_t size)
{
    size_t count = 0;
    while (count < size) {
        const ssize_t n = read(fd, bytes + count, size - count);
        if (n < 0 && errno == EINTR) {
            continue;
        }
        if (n <= 0) {
            break;
        }
        count += (size_t)n;
    }
    return count;
}

/* Return the size of one stimulus record in bytes: a time as double and the values as float. */
static size_t record_size(const struct stimulus *stimulus)
{
    return sizeof(double) + stimulus->value_count * sizeof(float);
}

/* Allocate the buffers of two records of `count` values and of the bytes of one record. Returns 0, or -1 after an error
 * line on stderr. */
static int allocate_values(struct stimulus *stimulus, size_t count)
{
    stimulus->value_count = count;
    stimulus->before = calloc(count, sizeof(float));
    stimulus->after = calloc(count, sizeof(float));
    stimulus->record = calloc(1, record_size(stimulus));
    return stimulus->before && stimulus->after && stimulus->record ? 0 : report_error(stimulus, "out of memory");
}

/* Read and check the header of a stimulus stream for a world with `taxels` taxels, and read the first record unless the
 * stream is live. fd -1: no stream; the stimulus is constant until values are set. Returns 0, or -1 after an error line
 * on stderr. */
int stimulus_open(struct stimulus *stimulus, int fd, const char *name, size_t taxels, bool live)
{
    uint8_t header[HEADER_SIZE]; /* TAXELSTM, then 32-bit numbers: version, kind, taxels, boards */
    memset(stimulus, 0, sizeof *stimulus);
    stimulus->fd = fd;
    stimulus->name = name;
    stimulus->is_live = live;
    stimulus->taxels = taxels;
    stimulus->until = VTIME_NEVER;
    if (fd < 0) {
        stimulus->has_ended = true;
        return allocate_values(stimulus, taxels);
    }
    if (read_fully(fd, header, sizeof header) != sizeof header || memcmp(header, "TAXELSTM", 8) != 0) {
        return report_error(stimulus, "expected a stimulus stream that starts with TAXELSTM");
    }
    if (get_u32(header + 8) != 1u || get_u32(header + 12) > STIMULUS_SCENE) {
        return report_error(stimulus,
                            "the version or kind of the stream is not supported; expected version 1, kind 0 to 2");
    }
    if (get_u32(header + 16) != taxels) {
        fprintf(stderr, "stimulus %s: expected values for %zu taxels, found %u\n", name, taxels, get_u32(header + 16));
        return -1;
    }
    stimulus->kind = (enum stimulus_kind)get_u32(header + 12);
    const uint32_t boards = get_u32(header + 20);
    if (stimulus->kind == STIMULUS_SCENE && (boards == 0u || boards > TAXEL_ADDRESS_MAX)) {
        return report_error(stimulus,
                            "the number of boards of the scene is 0 or larger than the number of I2C addresses");
    }
    if (allocate_values(stimulus, stimulus->kind == STIMULUS_SCENE ? STIMULUS_SCENE_VALUES(boards) : taxels)) {
        return -1;
    }
    return live ? 0 : stimulus_advance(stimulus, 0);
}

/* Close the stream and free the records. */
void stimulus_close(struct stimulus *stimulus)
{
    if (stimulus->fd >= 0) {
        close(stimulus->fd);
    }
    free(stimulus->before);
    free(stimulus->after);
    free(stimulus->record);
}

/* Convert the bytes of a complete record (f64 time in seconds, f32 values) to the next record. A negative time means
 * `now`, and the record then takes effect as a step. Returns 0, or -1 after an error line on stderr. */
static int parse_record(struct stimulus *stimulus, vtime now)
{
    double seconds;
    memcpy(&seconds, stimulus->record, sizeof seconds);
    if (!isfinite(seconds) || seconds > 1e7) {
        return report_error(stimulus, "the time of a record is not a number of seconds up to 1e7");
    }
    const vtime time = seconds < 0.0 ? now : (vtime)(seconds * (double)VTIME_SECOND);
    if (time < stimulus->from && stimulus->record_count) {
        return report_error(stimulus, "a record is earlier than the record before it");
    }
    memcpy(stimulus->after, stimulus->record + sizeof seconds, stimulus->value_count * sizeof(float));
    for (size_t i = 0; i < stimulus->value_count; i++) {
        if (!isfinite(stimulus->after[i]) || (stimulus->after[i] < 0.0f && stimulus->kind != STIMULUS_SCENE)) {
            return report_error(stimulus, "a value is negative or not finite");
        }
    }
    stimulus->is_step = seconds < 0.0 || stimulus->record_count == 0;
    stimulus->until = vtime_max(time, now);
    stimulus->record_count++;
    return 0;
}

/* Make the next record the present one; the following record is then unknown. Nothing happens if no next record is
 * known. */
static void activate_pending_record(struct stimulus *stimulus)
{
    if (stimulus->until == VTIME_NEVER) {
        return;
    }
    float *const spare = stimulus->before;
    stimulus->before = stimulus->after;
    stimulus->after = spare;
    stimulus->from = stimulus->until;
    stimulus->until = VTIME_NEVER;
}

/* Make the next record the present one and read the record after it, which blocks on a pipe or socket. The last record
 * stays in effect after the end of the stream. Returns 0, or -1 after an error line on stderr. */
int stimulus_advance(struct stimulus *stimulus, vtime now)
{
    activate_pending_record(stimulus);
    if (stimulus->has_ended || stimulus->is_live) {
        return 0;
    }
    const size_t size = read_fully(stimulus->fd, stimulus->record, record_size(stimulus));
    if (size == 0) {
        stimulus->has_ended = true;
        return 0;
    }
    if (size != record_size(stimulus)) {
        stimulus->has_ended = true;
        return report_error(stimulus, "the stream is truncated: it ends inside a record");
    }
    return parse_record(stimulus, now);
}

/* Read the bytes that a live stream has available, without blocking. Returns true when they complete a record; further
 * bytes stay in the stream for the next call. */
bool stimulus_receive_live(struct stimulus *stimulus)
{
    struct pollfd readable = {.fd = stimulus->fd, .events = POLLIN};
    while (stimulus->is_live && !stimulus->has_ended && poll(&readable, 1, 0) > 0) {
        const size_t missing = record_size(stimulus) - stimulus->record_fill;
        const ssize_t n = read(stimulus->fd, stimulus->record + stimulus->record_fill, missing);
        if (n <= 0) {
            stimulus->has_ended = true;
            return false;
        }
        stimulus->record_fill += (size_t)n;
        if (stimulus->record_fill == record_size(stimulus)) {
            stimulus->record_fill = 0;
            return true;
        }
    }
    return false;
}

/* Return the interpolation weight (0 to 1) of the next record at a time before that record. Counts and steps are held
 * until the next record, without interpolation. */
double stimulus_fraction(const struct stimulus *stimulus, vtime time)
{
    if (stimulus->until == VTIME_NEVER || stimulus->is_step || stimulus->kind == STIMULUS_COUNTS ||
        time <= stimulus->from) {
        return 0.0;
    }
    return (double)(time - stimulus->from) / (double)(stimulus->until - stimulus->from);
}

/* Return the force (newtons) or raw count of a taxel at a time between the present and the next record. */
double stimulus_value(const struct stimulus *stimulus, size_t taxel, vtime time)
{
    const double before = stimulus->before[taxel];
    const double fraction = stimulus_fraction(stimulus, time);
    return fraction == 0.0 ? before : before + fraction * (stimulus->after[taxel] - before);
}

/* Apply the record that stimulus_receive_live() completed: at once if its time has passed, otherwise as the next
 * record. Returns 0, or -1 after an error line on stderr. */
int stimulus_apply_live(struct stimulus *stimulus, vtime now)
{
    if (parse_record(stimulus, now)) {
        return -1;
    }
    if (stimulus->until <= now) {
        activate_pending_record(stimulus);
    }
    return 0;
}

/* Set the values of a stimulus without a stream, effective from `now` on. Returns 0, or -1 after an error line on
 * stderr. */
int stimulus_set_values(struct stimulus *stimulus, const float *values, vtime now)
{
    const double time_now = -1.0; /* a negative time means "now" */
    memcpy(stimulus->record, &time_now, sizeof time_now);
    memcpy(stimulus->record + sizeof time_now, values, stimulus->value_count * sizeof *values);
    return stimulus_apply_live(stimulus, now);
}
