/* The stimulus: what acts on the skin over time.
 *
 * Three kinds: forces in newtons on the taxels; recorded raw counts, which replace the front end; or a scene: an
 * object, and the poses of object and brackets.
 *
 * Stream format (file, pipe or socket, little-endian): header "TAXELSTM", u32 version 1, u32 kind, u32 taxels, u32
 * boards (0 unless the kind is scene); then records of f64 time in seconds and f32 values. Forces and counts: one value
 * per taxel. Scene: the number of the object in the world file (-1: none), the pose of the object in the world and the
 * pose of each bracket (12 values each: three rows of 4). Forces and scenes are interpolated linearly between records,
 * counts are held. In a live stream a negative time means "now". The values of the last record persist. */
#ifndef EMULATOR_SKIN_STIMULUS_H
#define EMULATOR_SKIN_STIMULUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/base/vtime.h"
#include "generated/taxel_protocol.h"

enum stimulus_kind {
    STIMULUS_FORCE = 0,
    STIMULUS_COUNTS = 1,
    STIMULUS_SCENE = 2,
};

#define STIMULUS_SCENE_VALUES(boards) (1u + 12u + 12u * (boards))

struct stimulus {
    int fd; /* -1: no stream */
    bool is_live;
    bool has_ended;
    bool is_step; /* the record at `until` takes effect at once, without interpolation */
    enum stimulus_kind kind;
    size_t taxels;
    size_t value_count; /* values of a record */
    vtime from, until;  /* times of `before` and `after`; until is VTIME_NEVER while no later record is known */
    float *before, *after;
    uint8_t *record;
    size_t record_fill;
    uint64_t record_count;
    const char *name;
};

/* Read the header of the stream `fd` (-1: no stream) and, unless it is live, the first record. Returns 0, or -1 after
 * one line on stderr that names the stream and the error. */
int stimulus_open(struct stimulus *stimulus, int fd, const char *name, size_t taxels, bool live);
void stimulus_close(struct stimulus *stimulus);

/* Read the next record: call when virtual time has reached `until`. Returns 0, or -1 after one line on stderr if the
 * record is truncated, earlier than the one before, or contains a value that is not finite. */
int stimulus_advance(struct stimulus *stimulus, vtime now);

/* Read the available bytes of a live stream. Returns whether a record is complete; stimulus_apply_live() then makes it
 * effective. */
bool stimulus_receive_live(struct stimulus *stimulus);
int stimulus_apply_live(struct stimulus *stimulus, vtime now);

/* Set the values [value_count] that act from now on, of a stimulus without a stream. Returns 0, or -1 after one line on
 * stderr if a value is not permitted. */
int stimulus_set_values(struct stimulus *stimulus, const float *values, vtime now);

/* Return the interpolation weight of `after` at a time in [from, until], 0 to 1. */
double stimulus_fraction(const struct stimulus *stimulus, vtime time);

/* Return the force (N) or count of a taxel at a time in [from, until]. */
double stimulus_value(const struct stimulus *stimulus, size_t taxel, vtime time);

#endif
