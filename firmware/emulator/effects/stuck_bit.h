/* Stuck bit in a board's count register: form `low` reads the bit as 0, form `high` as 1. Key bit= 0 to 15; several
 * lines add up. */
#ifndef EMULATOR_EFFECTS_STUCK_BIT_H
#define EMULATOR_EFFECTS_STUCK_BIT_H

#include <stdint.h>

#include "emulator/effects/effect_boards.h"

struct effect_line;
struct effects;

struct stuck_bit_effect {
    uint16_t low[EFFECT_BOARDS_MAX], high[EFFECT_BOARDS_MAX];
};

int stuck_bit_read(struct effect_line *line, struct effects *effects);

/* Return a raw count with the stuck bits of board number `board` applied. */
static inline uint16_t stuck_bit_apply(const struct stuck_bit_effect *stuck, size_t board, uint16_t raw)
{
    return (uint16_t)((raw & (uint16_t)~stuck->low[board]) | stuck->high[board]);
}

#endif
