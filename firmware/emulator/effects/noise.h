/* Read-out noise in addition to the white noise_counts: up to 8 lines that add up. All amplitudes are in counts before
 * quantisation; key board=.
 *
 * Form `white`: counts; independent for each conversion. Form `line`: counts; shared by the conversions of a scan on
 * one TX line (axis=0: coupled in while the line is driven), on one RX line (axis=1), or by the whole scan (axis=2: the
 * board's supply). Form `pink`: counts; 1/f noise from eight relaxation processes of equal variance with time constants
 * one octave apart from 20 ms on, so that the sum falls as 1/f from 0.06 to 8 Hz. Each process is updated exactly at
 * the start of a scan, once an eighth of its time constant has passed. Each taxel has its own processes (electrode);
 * with shared=1 the board has one set (converter). Form `impulse`: Poisson events at rate_hz on each board that add
 * +counts or -counts for duration_ms. */
#ifndef EMULATOR_EFFECTS_NOISE_H
#define EMULATOR_EFFECTS_NOISE_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/effects/effect_boards.h"
#include "emulator/base/normal_source.h"
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

/* Parameters of one line of the effect. */
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

/* Current values of one slot on one board. */
struct noise_state {
    struct random_source random;       /* for infrequent samples and samples that are not normal */
    struct normal_source normals;      /* for white noise */
    double common;                     /* form line: noise of the current TX line or scan, counts */
    double rx_values[TAXEL_LINES_MAX]; /* form line, axis 1: noise of each RX line, counts */
    double pink[TAXEL_TAXELS_MAX], process[NOISE_OCTAVES][TAXEL_TAXELS_MAX];
    double step_time[NOISE_OCTAVES]; /* seconds; time of the last step of each octave */
    bool has_started;
    double next_event, event_end, sign; /* form impulse: times in seconds; sign +1 or -1 */
};

struct noise_board {
    const struct noise_slot *slot[NOISE_SLOTS_MAX];
    struct noise_state state[NOISE_SLOTS_MAX];
    size_t count;
    int tx;
};

int noise_read(struct effect_line *line, struct effects *effects);
bool noise_is_on(const struct noise_effect *noise, size_t board);
void noise_open(struct noise_board *noise, const struct noise_effect *effect, size_t board, uint64_t seed,
                uint8_t address);

/* Sample the noise that is constant during a scan. time: start of the scan, seconds. taxels: of the board. */
void noise_begin_scan(struct noise_board *noise, double time, size_t taxels);

/* Return the noise in counts of the conversion of one crossing. time: seconds. */
double noise_counts(struct noise_board *noise, double time, int tx, int rx, size_t taxel);

#endif
