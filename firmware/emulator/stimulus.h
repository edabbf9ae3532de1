/* What acts on the skin over time: forces in newtons, or recorded raw counts that take the front end's place, or a scene: an
 * object, and where it and the brackets are.
 *
 * A stream of records, from a file, a pipe or a socket: header "TAXELSTM", u32 version 1, u32 kind, u32 taxels, u32 boards (0
 * unless a scene); then records of an f64 time in seconds and f32 values, all little-endian: one a taxel, or for a scene the
 * object's number in the world file (-1: none), its pose in the world and each bracket's (12 values: three rows of 4). Forces
 * and what follows from a scene are interpolated between records, counts are held. In a live stream a negative time means
 * now. After the last record its values stay. */
#ifndef EMULATOR_STIMULUS_H
#define EMULATOR_STIMULUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/vtime.h"
#include "generated/taxel_protocol.h"

enum stimulus_kind {
    STIMULUS_FORCE = 0,
    STIMULUS_COUNTS = 1,
    STIMULUS_SCENE = 2,
};

#define STIMULUS_SCENE_VALUES(boards) (1u + 12u + 12u * (boards))

struct stimulus {
    int fd; /* -1: nothing acts */
    bool live;
    bool ended;
    bool step; /* the record at `until` takes effect at once, without interpolation */
    enum stimulus_kind kind;
    size_t taxels;
    size_t values; /* in a record */
    vtime from, until; /* `before` holds at `from`, `after` at `until`; until is VTIME_NEVER while no record is known */
    float *before, *after;
    uint8_t *record;
    size_t record_fill;
    uint64_t records;
    const char *name;
};

/* Read the header. Returns 0, or -1 after a line on stderr that names the stream and what is wrong with it. */
int stimulus_open(struct stimulus *stimulus, int fd, const char *name, size_t taxels, bool live);
void stimulus_close(struct stimulus *stimulus);

/* Go on to the next record: call when virtual time has reached `until`. Returns -1 after a line on stderr for a record that
 * is cut short, goes back in time or is not finite. */
int stimulus_advance(struct stimulus *stimulus, vtime now);

/* Live streams only: is there a record to take up now? */
bool stimulus_poll(struct stimulus *stimulus);
int stimulus_take_live(struct stimulus *stimulus, vtime now);

/* Without a stream: these values act from now on, `stimulus->values` of them. Returns as above. */
int stimulus_set(struct stimulus *stimulus, const float *values, vtime now);

/* How far a time in [from, until] has come from the one record to the next, 0 to 1. */
double stimulus_fraction(const struct stimulus *stimulus, vtime time);

/* Force (newtons) or count of a taxel at a time in [from, until]. */
double stimulus_value(const struct stimulus *stimulus, size_t taxel, vtime time);

#endif
