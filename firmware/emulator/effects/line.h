/* Broken and short-circuited TX and RX lines; keys board=, axis= (0 TX line, 1 RX line), index= from 0.
 *
 * Form `open`: the crossings of the line lose their mutual capacitance; the remaining stub has stub_pf (0.05), which
 * contact does not change. Form `short`: lines index and index + 1 are connected. Their crossings are in parallel, and
 * both measure share (0.5) of the sum: two drivers of equal resistance, one driving and one at ground, halve the
 * voltage, and two RX switches halve the charge. A share of 1 means that the neighbour is floating. */
#ifndef EMULATOR_EFFECTS_LINE_H
#define EMULATOR_EFFECTS_LINE_H

#include <stdbool.h>
#include <stddef.h>

#include "generated/taxel_protocol.h"

#define LINE_EFFECTS_MAX 64

struct effect_line;
struct effects;

struct broken_line {
    size_t board;
    bool is_joined; /* short-circuited to the next line; otherwise open */
    int axis, index;
    double stub_f, share;
};

struct line_effect {
    struct broken_line lines[LINE_EFFECTS_MAX];
    size_t count;
};

int line_read(struct effect_line *line, struct effects *effects);
bool line_is_on(const struct line_effect *lines, size_t board);

/* Change the capacitances [tx][rx] (farad) of a board's crossings for its open and short-circuited lines. */
void line_apply(const struct line_effect *lines, size_t board, int tx_count, int rx_count,
                double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX]);

#endif
