/* Boards that do not respond on the bus: their address is not acknowledged, while they keep scanning.
 *
 * Form `from`: board= does not respond from `seconds` on, for `duration` seconds or without end. Form `flaky`: loose
 * contact. Each addressing is lost with probability p, in runs of mean length `burst` (4) addressings: a two-state
 * Markov chain that leaves the bad state with probability 1 / burst and enters it with p / (burst (1 - p)). */
#ifndef EMULATOR_EFFECTS_SILENT_H
#define EMULATOR_EFFECTS_SILENT_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/effects/effect_boards.h"
#include "emulator/base/random.h"

#define OUTAGES_MAX 64

struct effect_line;
struct effects;

struct silent_effect {
    struct {
        size_t board;
        double from, until; /* seconds */
    } outages[OUTAGES_MAX];
    size_t count;
    double probability[EFFECT_BOARDS_MAX], burst[EFFECT_BOARDS_MAX];
};

/* State of the loose contact of one board. */
struct silent_contact {
    struct random_source random;
    bool is_bad;
};

int silent_read(struct effect_line *line, struct effects *effects);
void silent_open(struct silent_contact *contact, const struct silent_effect *silent, size_t board, uint64_t seed,
                 uint8_t address);

/* Return whether the board does not acknowledge its address at a time in seconds. Each call advances the Markov chain
 * of the contact. */
bool silent_loses_addressing(const struct silent_effect *silent, size_t board, double time,
                             struct silent_contact *contact);

#endif
