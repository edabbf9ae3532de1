#include "emulator/effects/line.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define PICO 1e-12
#define STUB_PF 0.05

int line_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"open", "short", NULL};
    struct line_effect *lines = &effects->line;
    struct broken_line one = {0};
    const int form = effect_line_form_index(line, forms);
    long axis, index;
    if (form < 0 || effect_line_board(line, &one.board)) {
        return -1;
    }
    if (lines->count == LINE_EFFECTS_MAX) {
        return effect_line_report_error(line, "more than 64 broken lines");
    }
    const struct board_description *board = &line->boards[one.board];
    if (effect_line_integer(line, "axis", 0, 1, &axis)) {
        return -1;
    }
    const long last = (axis == 0 ? board->rows : board->columns) - 1 - (form == 1);
    if (last < 0) {
        return effect_line_report_error(line, "the line has no following neighbour to join");
    }
    if (effect_line_integer(line, "index", 0, last, &index) ||
        (form == 0 && effect_line_optional(line, "stub_pf", 0.0, 1.0, STUB_PF, &one.stub_f)) ||
        (form == 1 && effect_line_optional(line, "share", 0.1, 1.0, 0.5, &one.share))) {
        return -1;
    }
    one.stub_f *= PICO;
    one.is_joined = form == 1;
    one.axis = (int)axis;
    one.index = (int)index;
    lines->lines[lines->count++] = one;
    return 0;
}

bool line_is_on(const struct line_effect *lines, size_t board)
{
    for (size_t i = 0; i < lines->count; i++) {
        if (lines->lines[i].board == board) {
            return true;
        }
    }
    return false;
}

static double *crossing_of(double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX], int axis, int line, int n)
{
    return axis == 0 ? &mutual_f[line][n] : &mutual_f[n][line];
}

void line_apply(const struct line_effect *lines, size_t board, int tx_count, int rx_count,
                double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX])
{
    for (size_t i = 0; i < lines->count; i++) {
        const struct broken_line *line = &lines->lines[i];
        const int length = line->board != board ? 0 : line->axis == 0 ? rx_count : tx_count;
        for (int n = 0; n < length; n++) {
            double *const farad = crossing_of(mutual_f, line->axis, line->index, n);
            if (line->is_joined) {
                double *const neighbour = crossing_of(mutual_f, line->axis, line->index + 1, n);
                *farad = *neighbour = line->share * (*farad + *neighbour);
            } else if (*farad > 0.0) {
                *farad = line->stub_f;
            }
        }
    }
}
