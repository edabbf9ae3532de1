#include "emulator/effects/saturation.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

/* Read a world-file line `effect saturation`: limit of the signal in counts, sharp (`clip`) or gradual (`soft`), and
 * the strength of the effect (0 to 1). Returns 0, or -1 after an error line on stderr. */
int saturation_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"clip", "soft", NULL};
    struct saturation_board board;
    struct effect_boards boards;
    const int form = effect_line_form_index(line, forms);
    if (form < 0 || effect_line_boards(line, &boards) ||
        effect_line_number(line, "counts", 1.0, 65535.0, &board.counts) ||
        effect_line_optional(line, "strength", 0.0, 1.0, 1.0, &board.strength)) {
        return -1;
    }
    board.soft = form == 1;
    for (size_t i = boards.first; i < boards.end; i++) {
        effects->saturation.board[i] = board;
    }
    return 0;
}

/* Return the hardware count of a taxel after saturation. The rise x above the count without contact is limited to
 * `counts` (clip), or becomes x counts / (x + counts) because of the output resistance of the current source (soft).
 * `strength` interpolates between no effect (0) and this result (1). Counts below the count without contact are
 * unchanged. */
double saturation_limit(const struct saturation_board *board, double rest_count, double hardware_count)
{
    const double above = hardware_count - rest_count;
    if (board->strength == 0.0 || above <= 0.0) {
        return hardware_count;
    }
    const double limited = board->soft             ? above * board->counts / (above + board->counts)
                           : above > board->counts ? board->counts
                                                   : above;
    return hardware_count + board->strength * (limited - above);
}
