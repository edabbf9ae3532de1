/* Which boards an effect's line speaks of: the one after board=, or every board. */
#ifndef EMULATOR_EFFECTS_EFFECT_BOARDS_H
#define EMULATOR_EFFECTS_EFFECT_BOARDS_H

#include <stdbool.h>
#include <stddef.h>

#define EFFECT_BOARDS_MAX 64 /* WORLD_BOARDS_MAX; a board's place in the description */

struct effect_line;

struct effect_boards {
    size_t first, end;
};

/* Returns 0, or -1 after a complaint about an address that no board of this world has. */
int effect_line_boards(struct effect_line *line, struct effect_boards *boards);

static inline bool effect_boards_hold(const struct effect_boards *boards, size_t board)
{
    return board >= boards->first && board < boards->end;
}

#endif
