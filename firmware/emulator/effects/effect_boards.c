#include "emulator/effects/effect_boards.h"

#include <assert.h>

#include "emulator/effects/effect_line.h"

static_assert(EFFECT_BOARDS_MAX == WORLD_BOARDS_MAX, "an effect has parameters for every board of a world");

/* Read the range of boards to which an effect line applies: the board with the address after `board=`, or all boards if
 * the key is absent. Returns 0, or -1 after an error line on stderr. */
int effect_line_boards(struct effect_line *line, struct effect_boards *boards)
{
    *boards = (struct effect_boards){0, EFFECT_BOARDS_MAX};
    if (!effect_line_has_key(line, "board")) {
        return 0;
    }
    if (effect_line_board(line, &boards->first)) {
        return -1;
    }
    boards->end = boards->first + 1u;
    return 0;
}
