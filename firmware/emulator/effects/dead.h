/* Taxels that do not answer to what presses them; keys board= and taxel=, the index on the board.
 *
 * Form `rest`: the layer has come off the electrode: strength (1) of the rise does not reach it, and so the taxel gives its
 * rest count and the board's noise. Form `stuck`: the taxel's place in the snapshot is never written: always value. */
#ifndef EMULATOR_EFFECTS_DEAD_H
#define EMULATOR_EFFECTS_DEAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DEAD_MAX 128

struct effect_line;
struct effects;

struct dead_taxel {
    size_t board;
    uint16_t taxel;
    bool stuck;
    double strength; /* rest */
    uint16_t value;  /* stuck */
};

struct dead_effect {
    struct dead_taxel taxels[DEAD_MAX];
    size_t count;
};

int dead_read(struct effect_line *line, struct effects *effects);

/* The line that speaks of a taxel in that form, or NULL. */
const struct dead_taxel *dead_find(const struct dead_effect *dead, size_t board, uint16_t taxel, bool stuck);

#endif
