#include "emulator/effects/exchange.h"

#include <string.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

/* Read the address of the board that is exchanged with the board of the entry (each is plugged into the other's
 * socket). Both must have the same lines and crossing map, so that every taxel has a counterpart. Returns 0, or -1
 * after an error line on stderr. */
static int read_boards(struct effect_line *line, struct exchange *entry)
{
    const struct board_description *board = &line->boards[entry->board];
    long address;
    if (effect_line_integer(line, "other", TAXEL_ADDRESS_MIN, TAXEL_ADDRESS_MAX, &address)) {
        return -1;
    }
    for (size_t i = 0; i < line->board_count; i++) {
        const struct board_description *other = &line->boards[i];
        if (other->address == address) {
            entry->other_board = i;
            return i != entry->board && other->rows == board->rows && other->columns == board->columns &&
                           memcmp(other->crossing_map, board->crossing_map, sizeof other->crossing_map) == 0
                       ? 0
                       : effect_line_report_error(line, "expected two boards of one size and crossing map");
        }
    }
    return effect_line_report_error(line, "expected other= with the address of one of this world's boards");
}

/* Read the axis (0 TX, 1 RX) and the indices of two lines that are exchanged in the harness of the entry's board.
 * Returns 0, or -1 after an error line on stderr. */
static int read_lines(struct effect_line *line, struct exchange *entry)
{
    const struct board_description *board = &line->boards[entry->board];
    long axis, index, other;
    if (effect_line_integer(line, "axis", 0, 1, &axis)) {
        return -1;
    }
    const long last = (axis == 0 ? board->rows : board->columns) - 1;
    if (effect_line_integer(line, "index", 0, last, &index) || effect_line_integer(line, "other", 0, last, &other)) {
        return -1;
    }
    entry->lines = true;
    entry->axis = (int)axis;
    entry->index = (int)index;
    entry->other = (int)other;
    return 0;
}

/* Read a world-file line `effect exchange`: two boards, or two lines of a board, that are connected to each other's
 * socket. Returns 0, or -1 after an error line on stderr. */
int exchange_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"boards", "lines", NULL};
    struct exchange_effect *exchange = &effects->exchange;
    struct exchange entry = {0};
    const int form = effect_line_form_index(line, forms);
    if (form < 0 || effect_line_board(line, &entry.board)) {
        return -1;
    }
    if (exchange->count == EXCHANGES_MAX) {
        return effect_line_report_error(line, "more than 32 exchanges");
    }
    if (form == 0 ? read_boards(line, &entry) : read_lines(line, &entry)) {
        return -1;
    }
    exchange->exchanges[exchange->count++] = entry;
    return 0;
}

/* Return the index of the board whose skin the given board measures. Exchanges apply in the order of their lines in the
 * world file, so several of them compose to a permutation. */
size_t exchange_source_board(const struct exchange_effect *exchange, size_t board)
{
    for (size_t i = 0; i < exchange->count; i++) {
        const struct exchange *entry = &exchange->exchanges[i];
        if (!entry->lines && (board == entry->board || board == entry->other_board)) {
            board = board == entry->board ? entry->other_board : entry->board;
        }
    }
    return board;
}

/* Return the index of the electrode line to which line `index` of a board is wired (axis 0: TX, 1: RX). Exchanges apply
 * in the order of their lines in the world file. */
int exchange_source_line(const struct exchange_effect *exchange, size_t board, int axis, int index)
{
    for (size_t i = 0; i < exchange->count; i++) {
        const struct exchange *entry = &exchange->exchanges[i];
        if (entry->lines && entry->board == board && entry->axis == axis &&
            (index == entry->index || index == entry->other)) {
            index = index == entry->index ? entry->other : entry->index;
        }
    }
    return index;
}
