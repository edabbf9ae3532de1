/* Plugs in the wrong sockets. The map believes the address; the skin believes the wire.
 *
 * Form `boards`: board= and other= are swapped: each measures what presses the other. Refused unless both have the same
 * crossings. Form `lines`: lines index= and other= of one board's axis= (0 TX, 1 RX) are swapped in the harness: the board
 * measures another crossing than it thinks, and nothing where that has no taxel. */
#ifndef EMULATOR_EFFECTS_EXCHANGE_H
#define EMULATOR_EFFECTS_EXCHANGE_H

#include <stdbool.h>
#include <stddef.h>

#define EXCHANGES_MAX 32

struct effect_line;
struct effects;

struct exchange {
    bool lines; /* else boards */
    size_t board, other_board;
    int axis, index, other;
};

struct exchange_effect {
    struct exchange exchanges[EXCHANGES_MAX];
    size_t count;
};

int exchange_read(struct effect_line *line, struct effects *effects);

/* The board whose skin this board measures; and the line that its line is wired to. */
size_t exchange_board(const struct exchange_effect *exchange, size_t board);
int exchange_line(const struct exchange_effect *exchange, size_t board, int axis, int index);

#endif
