/* Read-out noise beyond the white noise_counts: up to 8 lines that add up. All in counts before quantisation; key board=.
 *
 * Form `white`: counts, a new number for each conversion.
 * Form `line`: counts, shared by the conversions of a scan on one TX line (axis=0: what couples in while it is driven), on
 * one RX line (axis=1), or by the whole scan (axis=2: the board's supply).
 * Form `pink`: counts, 1/f: eight relaxation processes of one variance, whose times lie octaves apart from 20 ms on, so that
 * the sum falls with 1/f from 0.06 to 8 Hz. Each steps at the start of a scan, exactly for the time since its last step,
 * once an eighth of its own time has gone. Each taxel has its own (electrode), with shared=1 the board has one (converter).
 * Form `impulse`: rate_hz Poisson events a second on each board that add +counts or -counts for duration_ms. */
#ifndef EMULATOR_EFFECTS_NOISE_H
#define EMULATOR_EFFECTS_NOISE_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/effects/effect_boards.h"
#include "emulator/normals.h"
#include "generated/taxel_protocol.h"

#define NOISE_SLOTS_MAX 8
#define NOISE_OCTAVES 8

struct effect_line;
struct effects;

enum noise_form {
    NOISE_WHITE,
    NOISE_LINE,
    NOISE_PINK,
    NOISE_IMPULSE,
};

struct noise_slot {
    enum noise_form form;
    struct effect_boards boards;
    double counts;
    int axis;
    bool shared;
    double rate_hz, duration_s;
};

struct noise_effect {
    struct noise_slot slots[NOISE_SLOTS_MAX];
    size_t count;
};

/* One slot's present values on one board. */
struct noise_state {
    struct random_source random; /* of what is drawn seldom, or not normal */
    struct normals normals;      /* of white noise */
    double common;                 /* line: of the TX line or scan under way */
    double of_rx[TAXEL_LINES_MAX]; /* line, axis 1 */
    double pink[TAXEL_TAXELS_MAX], process[NOISE_OCTAVES][TAXEL_TAXELS_MAX];
    double stepped[NOISE_OCTAVES]; /* seconds; when each octave stepped last */
    bool has_begun;
    double next, until, sign;      /* impulse: seconds */
};

struct noise_board {
    const struct noise_slot *slot[NOISE_SLOTS_MAX];
    struct noise_state state[NOISE_SLOTS_MAX];
    size_t count;
    int tx;
};

int noise_read(struct effect_line *line, struct effects *effects);
bool noise_is_on(const struct noise_effect *noise, size_t board);
void noise_open(struct noise_board *noise, const struct noise_effect *effect, size_t board, uint64_t seed, uint8_t address);

/* A new scan begins at that time, seconds; then the counts that each conversion adds. */
void noise_begin_scan(struct noise_board *noise, double time, size_t taxels);
double noise_counts(struct noise_board *noise, double time, int tx, int rx, size_t taxel);

#endif
