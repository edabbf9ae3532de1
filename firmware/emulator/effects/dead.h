/* Taxels that do not respond to contact; keys board= and taxel= (index on the board).
 *
 * Form `rest`: the layer is detached from the electrode; a share `strength` (1) of the rise is lost, so the taxel
 * returns its rest count plus the board's noise. Form `stuck`: the taxel's entry in the snapshot is never written and
 * always equals value. */
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

/* Parameters of a dead taxel in that form, or NULL. */
const struct dead_taxel *dead_find_taxel(const struct dead_effect *dead, size_t board, uint16_t taxel, bool stuck);

#endif
