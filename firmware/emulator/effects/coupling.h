/* Electrode crosstalk: resistances of the lines and capacitances between traces, solved as a network (network.h).
 *
 * Form `resistive`: tx_ohm is the resistance of driver and line, rx_ohm of line and multiplexer, ground_pf the
 * parasitic capacitance of a line to ground. With both resistances 0 the sensor is ideal. Form `traces`: as
 * `resistive`, plus picofarad between neighbouring TX lines and between neighbouring RX lines; 0 is ideal.
 *
 * The excitation is the fundamental of the TX clock, omega = 2 pi F_tx of the scan settings. The signal lost in the
 * lines is compensated once, as firmware calibrates its current source, so that the board's mean count at rest is
 * unchanged. */
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

/* Network of one board, and the last solution for each TX line, which remains valid while no capacitance changes. */
struct coupling_lines {
    struct network network;
    double calibration; /* factor on every effective capacitance */
    unsigned version;   /* incremented when a capacitance changes */
    /* version of each TX line's solution; 0: no solution */
    unsigned solved_version[TAXEL_LINES_MAX];
    struct network_state state[TAXEL_LINES_MAX];
    double effective_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
};

int coupling_read(struct effect_line *line, struct effects *effects);
bool coupling_is_on(const struct coupling_effect *coupling, size_t board);

/* Set the network's parameters. Call at the start and after each change of the TX clock. */
void coupling_configure(struct coupling_lines *lines, const struct coupling_board *board, int tx_count, int rx_count,
                        double tx_hz);
/* Set the calibration so that the mean over these capacitances [tx][rx] (farad, 0 without a taxel) is unchanged. */
void coupling_calibrate(struct coupling_lines *lines, double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX]);

/* Set the capacitances [tx][rx] of the crossings, farad. */
void coupling_set_capacitances(struct coupling_lines *lines, double mutual_f[TAXEL_LINES_MAX][TAXEL_LINES_MAX]);

/* Return the capacitance (farad) of a crossing that the converter measures. */
double coupling_effective_capacitance(struct coupling_lines *lines, int tx, int rx);

#endif
