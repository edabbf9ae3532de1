/* Taxels that do not respond to contact; keys board= and taxel= (index on the board).
 *
 * Form `rest`: the layer is detached from the electrode. A share `strength` (default 1) of the rise of the capacitance
 * under contact is lost; with 1, the taxel returns its count without contact plus the board's noise. Form `stuck`: the
 * taxel's entry in the snapshot is never written and always equals value. */
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
    bool is_stuck;
    double strength; /* of form `rest` */
    uint16_t value;  /* stuck */
};

struct dead_effect {
    struct dead_taxel taxels[DEAD_MAX];
    size_t count;
};

int dead_read(struct effect_line *line, struct effects *effects);

/* Return the parameters of a dead taxel, or NULL if the taxel is healthy. is_stuck: search the form `stuck` instead of
 * `rest`. */
const struct dead_taxel *dead_find_taxel(const struct dead_effect *dead, size_t board, uint16_t taxel, bool is_stuck);

#endif
