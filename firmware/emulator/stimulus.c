#include "emulator/stimulus.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define HEADER_SIZE 24u

static uint32_t get_u32(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

static int complain(const struct stimulus *stimulus, const char *what)
{
    fprintf(stderr, "stimulus %s, after %llu records: %s\n", stimulus->name, (unsigned long long)stimulus->records, what);
    return -1;
}

/* Bytes read, which are fewer than `size` only at the end of the stream. */
static size_t read_fully(int fd, uint8_t *bytes, size_t size)
{
    size_t got = 0;
    while (got < size) {
        const ssize_t n = read(fd, bytes + got, size - got);
        if (n < 0 && errno == EINTR) {
            continue;
        }
        if (n <= 0) {
            break;
        }
        got += (size_t)n;
    }
    return got;
}

static size_t record_size(const struct stimulus *stimulus)
{
    return sizeof(double) + stimulus->values * sizeof(float);
}

static int make_room(struct stimulus *stimulus, size_t values)
{
    stimulus->values = values;
    stimulus->before = calloc(values, sizeof(float));
    stimulus->after = calloc(values, sizeof(float));
    stimulus->record = calloc(1, record_size(stimulus));
    return stimulus->before && stimulus->after && stimulus->record ? 0 : complain(stimulus, "out of memory");
}

int stimulus_open(struct stimulus *stimulus, int fd, const char *name, size_t taxels, bool live)
{
    uint8_t header[HEADER_SIZE];
    memset(stimulus, 0, sizeof *stimulus);
    stimulus->fd = fd;
    stimulus->name = name;
    stimulus->live = live;
    stimulus->taxels = taxels;
    stimulus->until = VTIME_NEVER;
    if (fd < 0) {
        stimulus->ended = true;
        return make_room(stimulus, taxels);
    }
    if (read_fully(fd, header, sizeof header) != sizeof header || memcmp(header, "TAXELSTM", 8) != 0) {
        return complain(stimulus, "this is not a stimulus stream (it does not begin with TAXELSTM)");
    }
    if (get_u32(header + 8) != 1u || get_u32(header + 12) > STIMULUS_SCENE) {
        return complain(stimulus, "its version or kind is unknown to this emulator");
    }
    if (get_u32(header + 16) != taxels) {
        fprintf(stderr, "stimulus %s: is for %u taxels, but this skin has %zu\n", name, get_u32(header + 16), taxels);
        return -1;
    }
    stimulus->kind = (enum stimulus_kind)get_u32(header + 12);
    const uint32_t boards = get_u32(header + 20);
    if (stimulus->kind == STIMULUS_SCENE && (boards == 0u || boards > TAXEL_ADDRESS_MAX)) {
        return complain(stimulus, "a scene of no boards, or of more than a bus holds");
    }
    if (make_room(stimulus, stimulus->kind == STIMULUS_SCENE ? STIMULUS_SCENE_VALUES(boards) : taxels)) {
        return -1;
    }
    return live ? 0 : stimulus_advance(stimulus, 0);
}

void stimulus_close(struct stimulus *stimulus)
{
    if (stimulus->fd >= 0) {
        close(stimulus->fd);
    }
    free(stimulus->before);
    free(stimulus->after);
    free(stimulus->record);
}

static int take_record(struct stimulus *stimulus, vtime now)
{
    double seconds;
    memcpy(&seconds, stimulus->record, sizeof seconds);
    if (!isfinite(seconds) || seconds > 1e7) {
        return complain(stimulus, "a record's time is not a number of seconds");
    }
    const vtime time = seconds < 0.0 ? now : (vtime)(seconds * (double)VTIME_SECOND);
    if (time < stimulus->from && stimulus->records) {
        return complain(stimulus, "a record goes back in time");
    }
    memcpy(stimulus->after, stimulus->record + sizeof seconds, stimulus->values * sizeof(float));
    for (size_t i = 0; i < stimulus->values; i++) {
        if (!isfinite(stimulus->after[i]) || (stimulus->after[i] < 0.0f && stimulus->kind != STIMULUS_SCENE)) {
            return complain(stimulus, "a value is negative or not a number");
        }
    }
    stimulus->step = seconds < 0.0 || stimulus->records == 0;
    stimulus->until = vtime_max(time, now);
    stimulus->records++;
    return 0;
}

static void adopt_pending(struct stimulus *stimulus)
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

int stimulus_advance(struct stimulus *stimulus, vtime now)
{
    adopt_pending(stimulus);
    if (stimulus->ended || stimulus->live) {
        return 0;
    }
    const size_t got = read_fully(stimulus->fd, stimulus->record, record_size(stimulus));
    if (got == 0) {
        stimulus->ended = true;
        return 0;
    }
    if (got != record_size(stimulus)) {
        stimulus->ended = true;
        return complain(stimulus, "the stream ends inside a record");
    }
    return take_record(stimulus, now);
}

bool stimulus_poll(struct stimulus *stimulus)
{
    struct pollfd waiting = {.fd = stimulus->fd, .events = POLLIN};
    while (stimulus->live && !stimulus->ended && poll(&waiting, 1, 0) > 0) {
        const size_t want = record_size(stimulus) - stimulus->record_fill;
        const ssize_t n = read(stimulus->fd, stimulus->record + stimulus->record_fill, want);
        if (n <= 0) {
            stimulus->ended = true;
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

double stimulus_fraction(const struct stimulus *stimulus, vtime time)
{
    if (stimulus->until == VTIME_NEVER || stimulus->step || stimulus->kind == STIMULUS_COUNTS || time <= stimulus->from) {
        return 0.0;
    }
    return (double)(time - stimulus->from) / (double)(stimulus->until - stimulus->from);
}

double stimulus_value(const struct stimulus *stimulus, size_t taxel, vtime time)
{
    const double before = stimulus->before[taxel];
    const double fraction = stimulus_fraction(stimulus, time);
    return fraction == 0.0 ? before : before + fraction * (stimulus->after[taxel] - before);
}

int stimulus_take_live(struct stimulus *stimulus, vtime now)
{
    if (take_record(stimulus, now)) {
        return -1;
    }
    if (stimulus->until <= now) {
        adopt_pending(stimulus);
    }
    return 0;
}

int stimulus_set(struct stimulus *stimulus, const float *values, vtime now)
{
    const double at_once = -1.0;
    memcpy(stimulus->record, &at_once, sizeof at_once);
    memcpy(stimulus->record + sizeof at_once, values, stimulus->values * sizeof *values);
    return stimulus_take_live(stimulus, now);
}
