/* TX and RX lines that are broken or joined; keys board=, axis= (0 a TX line, 1 an RX line), index= from 0.
 *
 * Form `open`: the line's crossings lose their mutual capacitance; stub_pf (0.05) of the end that is left stays, and nothing
 * on the skin changes it. Form `short`: lines index and index + 1 are joined. Their crossings lie in parallel; share (0.5) of
 * the sum is measured through both: two drivers of one resistance, one driving and one at ground, leave half of the voltage,
 * and so do two RX switches of the charge. A share of 1 is a neighbour that nothing holds. */
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
    bool joined; /* with its neighbour; else open */
    int axis, index;
    double stub_f, share;
};

struct line_effect {
    struct broken_line lines[LINE_EFFECTS_MAX];
    size_t count;
};

int line_read(struct effect_line *line, struct effects *effects);
bool line_is_on(const struct line_effect *lines, size_t board);

/* The crossings' capacitances [tx][rx], farad, as they are through broken and joined lines. */
void line_apply(const struct line_effect *lines, size_t board, int tx_count, int rx_count,
                double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX]);

#endif
