#include "emulator/effects/line.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define PICO 1e-12
#define STUB_PF 0.05

/* Read a world-file line `effect line`: an open TX or RX line (axis 0 or 1) with a remaining stub capacitance (pF), or
 * a short circuit to the following line. Returns 0, or -1 after an error line on stderr. */
int line_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"open", "short", NULL};
    struct line_effect *lines = &effects->line;
    struct broken_line entry = {0};
    const int form = effect_line_form_index(line, forms);
    long axis, index;
    if (form < 0 || effect_line_board(line, &entry.board)) {
        return -1;
    }
    if (lines->count == LINE_EFFECTS_MAX) {
        return effect_line_report_error(line, "more than 64 broken lines");
    }
    const struct board_description *board = &line->boards[entry.board];
    if (effect_line_integer(line, "axis", 0, 1, &axis)) {
        return -1;
    }
    const long last = (axis == 0 ? board->rows : board->columns) - 1 - (form == 1);
    if (last < 0) {
        return effect_line_report_error(line, "the line has no following neighbour to join");
    }
    if (effect_line_integer(line, "index", 0, last, &index) ||
        (form == 0 && effect_line_optional(line, "stub_pf", 0.0, 1.0, STUB_PF, &entry.stub_f)) ||
        (form == 1 && effect_line_optional(line, "share", 0.1, 1.0, 0.5, &entry.share))) {
        return -1;
    }
    entry.stub_f *= PICO;
    entry.is_joined = form == 1;
    entry.axis = (int)axis;
    entry.index = (int)index;
    lines->lines[lines->count++] = entry;
    return 0;
}

/* Return whether a line of this board is open or short-circuited. */
bool line_is_on(const struct line_effect *lines, size_t board)
{
    for (size_t i = 0; i < lines->count; i++) {
        if (lines->lines[i].board == board) {
            return true;
        }
    }
    return false;
}

/* Return a pointer to the capacitance of the n-th crossing on TX line (axis 0) or RX line (axis 1) number `line`. */
static double *get_crossing(double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX], int axis, int line, int n)
{
    return axis == 0 ? &mutual_f[line][n] : &mutual_f[n][line];
}

/* Change the mutual capacitances [tx][rx] (farad) for the faulty lines of a board. Crossings of an open line keep
 * only the capacitance of the stub. Two short-circuited lines both measure a share of the sum of their parallel
 * crossings. */
void line_apply(const struct line_effect *lines, size_t board, int tx_count, int rx_count,
                double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX])
{
    for (size_t i = 0; i < lines->count; i++) {
        const struct broken_line *line = &lines->lines[i];
        const int length = line->board != board ? 0 : line->axis == 0 ? rx_count : tx_count;
        for (int n = 0; n < length; n++) {
            double *const farad = get_crossing(mutual_f, line->axis, line->index, n);
            if (line->is_joined) {
                double *const neighbour = get_crossing(mutual_f, line->axis, line->index + 1, n);
                *farad = *neighbour = line->share * (*farad + *neighbour);
            } else if (*farad > 0.0) {
                *farad = line->stub_f;
            }
        }
    }
}
