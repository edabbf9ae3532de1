/* Electrode crosstalk: the lines' resistances, and the capacitances between traces, solved as a network (network.h).
 *
 * Form `resistive`: tx_ohm and rx_ohm, the driver and its line, the line and the multiplexer before the converter; ground_pf a
 * line's parasitic to ground. Both resistances 0 is the ideal sensor.
 * Form `traces`: besides, picofarad between neighbouring TX lines and between neighbouring RX lines. 0 is the ideal sensor.
 * The excitation is the fundamental of the TX clock: omega = 2 pi F_tx of the scan settings. What the lines lose is made up for
 * once, as firmware calibrates its current source: the board's mean count at rest stays. */
#ifndef EMULATOR_EFFECTS_COUPLING_H
#define EMULATOR_EFFECTS_COUPLING_H

#include <stdbool.h>

#include "emulator/effects/effect_boards.h"
#include "emulator/effects/network.h"

struct effect_line;
struct effects;

struct coupling_board {
    double tx_ohm, rx_ohm, ground_f, trace_f;
};

struct coupling_effect {
    struct coupling_board board[EFFECT_BOARDS_MAX];
};

/* One board's lines, and the last solution for each TX line, which stays while no capacitance changes. */
struct coupling_lines {
    struct network network;
    double calibration; /* what every effective capacitance is multiplied with */
    unsigned version;                                         /* of the capacitances */
    unsigned solved[TAXEL_LINES_MAX];                         /* version of each TX line's solution; 0 none */
    struct network_state state[TAXEL_LINES_MAX];
    double effective_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
};

int coupling_read(struct effect_line *line, struct effects *effects);
bool coupling_is_on(const struct coupling_effect *coupling, size_t board);

/* At the start, and after a change of the TX clock. */
void coupling_configure(struct coupling_lines *lines, const struct coupling_board *board, int tx_count, int rx_count, double tx_hz);
/* Make up for what the lines lose of these capacitances [tx][rx], farad; 0 where no taxel is. */
void coupling_calibrate(struct coupling_lines *lines, double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX]);

/* The crossings' capacitances [tx][rx], farad, have changed. */
void coupling_set(struct coupling_lines *lines, double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX]);

/* What the converter sees of a crossing while the lines have the capacitances that were set, farad. */
double coupling_effective(struct coupling_lines *lines, int tx, int rx);

#endif
