/* Connectors in the wrong sockets: addresses and hand description no longer match the wiring.
 *
 * Form `boards`: board= and other= are exchanged; each board measures the contact on the other. Both boards must have
 * the same crossing map. Form `lines`: lines index= and other= of one board's axis= (0 TX, 1 RX) are exchanged in the
 * harness, so the board measures the crossing of the other line, or no taxel if that crossing has none. */
#ifndef EMULATOR_EFFECTS_EXCHANGE_H
#define EMULATOR_EFFECTS_EXCHANGE_H

#include <stdbool.h>
#include <stddef.h>

#define EXCHANGES_MAX 32

struct effect_line;
struct effects;

struct exchange {
    bool lines; /* true: two lines of `board` are exchanged; false: `board` and `other_board` */
    size_t board, other_board;
    int axis, index, other;
};

struct exchange_effect {
    struct exchange exchanges[EXCHANGES_MAX];
    size_t count;
};

int exchange_read(struct effect_line *line, struct effects *effects);

/* Return the index of the board whose skin this board measures. */
size_t exchange_source_board(const struct exchange_effect *exchange, size_t board);

/* Return the electrode line to which line `index` of this board is wired. axis: 0 TX, 1 RX. */
int exchange_source_line(const struct exchange_effect *exchange, size_t board, int axis, int index);

#endif
