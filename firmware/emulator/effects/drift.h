/* Capacitances that move with temperature. Keys counts= (at rest, under the world's scan settings), seconds=, board=,
 * share= (0.3): how much of it differs from taxel to taxel.
 *
 * Form `warm_up`: from power on, the board heats its traces with one time constant s, and through them, three times as slow,
 * the layer of each taxel. A board's size is counts * exp(0.3 n); a taxel's capacitance moves by
 *   size * ((1 - e^(-t/s)) + share * n_taxel * (1 - (3 e^(-t/3s) - e^(-t/s)) / 2)).
 * Form `wander`: the room. The board's temperature is an Ornstein-Uhlenbeck process of standard deviation counts and
 * correlation time seconds, stepped exactly at the start of each scan; a taxel follows it with 1 + share * n_taxel.
 * n: standard normal numbers of the board and the taxel. Lines add up, up to 8. */
#ifndef EMULATOR_EFFECTS_DRIFT_H
#define EMULATOR_EFFECTS_DRIFT_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/effects/effect_boards.h"
#include "emulator/random.h"
#include "generated/taxel_protocol.h"

#define DRIFT_SLOTS_MAX 8

struct effect_line;
struct effects;

struct drift_slot {
    bool wanders;
    struct effect_boards boards;
    double counts, seconds, share;
};

struct drift_effect {
    struct drift_slot slots[DRIFT_SLOTS_MAX];
    size_t count;
};

struct drift_board {
    const struct drift_slot *slot[DRIFT_SLOTS_MAX];
    struct {
        struct random_source random;
        double size, common, own; /* counts: the board's, and what a share of 1 adds now */
        double stepped;           /* wander: seconds */
        bool has_begun;
        double taxel[TAXEL_TAXELS_MAX]; /* share * n */
    } state[DRIFT_SLOTS_MAX];
    size_t count;
};

int drift_read(struct effect_line *line, struct effects *effects);
bool drift_is_on(const struct drift_effect *drift, size_t board);
void drift_open(struct drift_board *drift, const struct drift_effect *effect, size_t board, uint64_t seed, uint8_t address);

/* A new scan begins at that time; the board was switched on at the other, seconds. */
void drift_begin_scan(struct drift_board *drift, double time, double powered);

/* What it adds to a taxel's capacitance during this scan, in counts of the world's scan settings. */
double drift_counts(const struct drift_board *drift, size_t taxel);

#endif
