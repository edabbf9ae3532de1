/* Capacitances that drift with temperature. Keys: counts= (amplitude, in counts under the world's scan settings),
 * seconds= (time constant), board=, share= (default 0.3; standard deviation between taxels relative to the drift of the
 * board).
 *
 * Form `warm_up`: after power-on the board heats its traces with one time constant s and, through the traces, the layer
 * of each taxel with 3 s. The amplitude of a board is counts * exp(0.3 n); the capacitance of a taxel changes by
 *     amplitude * ((1 - e^(-t/s)) + share * n_taxel * (1 - (3 e^(-t/3s) - e^(-t/s)) / 2)).
 * Form `wander`: ambient temperature. The board's temperature is an Ornstein-Uhlenbeck process with standard deviation
 * `counts` and correlation time `seconds`, updated exactly at the start of each scan; a taxel follows with
 * factor 1 + share * n_taxel. n, n_taxel: standard normal numbers of the board and of the taxel. The drifts of up to 8
 * lines add up. */
#ifndef EMULATOR_EFFECTS_DRIFT_H
#define EMULATOR_EFFECTS_DRIFT_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/effects/effect_boards.h"
#include "emulator/base/random.h"
#include "generated/taxel_protocol.h"

#define DRIFT_SLOTS_MAX 8

struct effect_line;
struct effects;

/* Parameters of one line of the effect. */
struct drift_slot {
    bool is_random;
    struct effect_boards boards;
    double counts, seconds, share;
};

struct drift_effect {
    struct drift_slot slots[DRIFT_SLOTS_MAX];
    size_t count;
};

/* Drifts of one board: the lines that act on it and their states. */
struct drift_board {
    const struct drift_slot *slot[DRIFT_SLOTS_MAX];
    struct {
        struct random_source random;
        double amplitude;       /* of the board, counts */
        double common;          /* current drift of the board, counts */
        double taxel_amplitude; /* current drift for a taxel share of 1, counts */
        double step_time;       /* time of the last step of a random drift, seconds */
        bool has_started;
        double taxel[TAXEL_TAXELS_MAX]; /* share * n */
    } state[DRIFT_SLOTS_MAX];
    size_t count;
};

int drift_read(struct effect_line *line, struct effects *effects);
bool drift_is_on(const struct drift_effect *drift, size_t board);
void drift_open(struct drift_board *drift, const struct drift_effect *effect, size_t board, uint64_t seed,
                uint8_t address);

/* Update the drift at the start of a scan. time: now; powered: power-on time of the board; both in seconds. */
void drift_begin_scan(struct drift_board *drift, double time, double powered);

/* Return the drift of a taxel's capacitance during this scan, in counts under the world's scan settings. */
double drift_counts(const struct drift_board *drift, size_t taxel);

#endif
