#include "emulator/effects/exchange.h"

#include <string.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

static int read_boards(struct effect_line *line, struct exchange *one)
{
    const struct board_description *board = &line->boards[one->board];
    long address;
    if (effect_line_integer(line, "other", TAXEL_ADDRESS_MIN, TAXEL_ADDRESS_MAX, &address)) {
        return -1;
    }
    for (size_t i = 0; i < line->board_count; i++) {
        const struct board_description *other = &line->boards[i];
        if (other->address == address) {
            one->other_board = i;
            return i != one->board && other->rows == board->rows && other->columns == board->columns &&
                           memcmp(other->crossing_map, board->crossing_map, sizeof other->crossing_map) == 0
                       ? 0
                       : effect_line_report_error(line, "expected two boards of one size and crossing map");
        }
    }
    return effect_line_report_error(line, "expected other= with the address of one of this world's boards");
}

static int read_lines(struct effect_line *line, struct exchange *one)
{
    const struct board_description *board = &line->boards[one->board];
    long axis, index, other;
    if (effect_line_integer(line, "axis", 0, 1, &axis)) {
        return -1;
    }
    const long last = (axis == 0 ? board->rows : board->columns) - 1;
    if (effect_line_integer(line, "index", 0, last, &index) || effect_line_integer(line, "other", 0, last, &other)) {
        return -1;
    }
    one->lines = true;
    one->axis = (int)axis;
    one->index = (int)index;
    one->other = (int)other;
    return 0;
}

int exchange_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"boards", "lines", NULL};
    struct exchange_effect *exchange = &effects->exchange;
    struct exchange one = {0};
    const int form = effect_line_form_index(line, forms);
    if (form < 0 || effect_line_board(line, &one.board)) {
        return -1;
    }
    if (exchange->count == EXCHANGES_MAX) {
        return effect_line_report_error(line, "more than 32 exchanges");
    }
    if (form == 0 ? read_boards(line, &one) : read_lines(line, &one)) {
        return -1;
    }
    exchange->exchanges[exchange->count++] = one;
    return 0;
}

size_t exchange_source_board(const struct exchange_effect *exchange, size_t board)
{
    for (size_t i = 0; i < exchange->count; i++) {
        const struct exchange *one = &exchange->exchanges[i];
        if (!one->lines && (board == one->board || board == one->other_board)) {
            board = board == one->board ? one->other_board : one->board;
        }
    }
    return board;
}

int exchange_source_line(const struct exchange_effect *exchange, size_t board, int axis, int index)
{
    for (size_t i = 0; i < exchange->count; i++) {
        const struct exchange *one = &exchange->exchanges[i];
        if (one->lines && one->board == board && one->axis == axis && (index == one->index || index == one->other)) {
            index = index == one->index ? one->other : one->index;
        }
    }
    return index;
}
