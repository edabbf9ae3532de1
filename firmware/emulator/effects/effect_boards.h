/* Range of boards to which a line of an effect applies: the board after board=, or every board. */
#ifndef EMULATOR_EFFECTS_EFFECT_BOARDS_H
#define EMULATOR_EFFECTS_EFFECT_BOARDS_H

#include <stdbool.h>
#include <stddef.h>

#define EFFECT_BOARDS_MAX 64 /* equals WORLD_BOARDS_MAX; boards are indexed by their order in the description */

struct effect_line;

struct effect_boards {
    size_t first, end;
};

/* Read the range of boards of an effect line. Returns 0, or -1 after one line on stderr if no board has the address. */
int effect_line_boards(struct effect_line *line, struct effect_boards *boards);

/* Return whether board number `board` lies in the range. */
static inline bool effect_boards_contain(const struct effect_boards *boards, size_t board)
{
    return board >= boards->first && board < boards->end;
}

#endif
