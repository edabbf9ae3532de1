/* The lines of a board as a network: capacitances between lines, resistances to what drives or holds them.
 *
 * One TX line is driven through tx_ohm with a sine of amplitude 1 at omega; the others are held at ground through tx_ohm.
 * Every RX line is held at the converter's virtual ground through rx_ohm. With node voltages V and capacitances C
 *
 *   (V_i - drive_i) / tx_ohm + j omega (ground + sum_n C_in) V_i = j omega sum_n C_in V_n      (TX lines i)
 *   V_k / rx_ohm + j omega (ground + sum_n C_kn) V_k = j omega sum_n C_kn V_n                  (RX lines k)
 *
 * where n runs over the crossings and the neighbouring lines. RX line k collects I_k = V_k / rx_ohm; the converter, clocked
 * with the drive, takes the part in quadrature to the voltage: an effective capacitance Im(I_k) / omega, which is C_dk
 * without resistances. All RX lines are held alike, so one solution serves every RX line of a scan step. */
#ifndef EMULATOR_EFFECTS_NETWORK_H
#define EMULATOR_EFFECTS_NETWORK_H

#include <stdbool.h>

#include "generated/taxel_protocol.h"

/* What the sum of a line's currents is multiplied with: 1 / (1 + j omega R C), complex. */
struct network_lines {
    double re[TAXEL_LINES_MAX], im[TAXEL_LINES_MAX];
};

struct network {
    int tx_count, rx_count;
    double tx_ohm, rx_ohm, omega; /* ohm, ohm, radian a second */
    double ground_f, trace_f;     /* a line's parasitic to ground; between neighbouring lines; farad */
    double mutual[TAXEL_LINES_MAX][TAXEL_LINES_MAX]; /* [tx][rx] farad; 0 where no taxel is */

    bool changed; /* since the last solution; what follows is then made anew */
    double transposed[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
    struct network_lines tx_share, rx_share;
};

/* Where the iteration starts from and what it ends with; all zero at first. The RX lines' values are currents over omega. */
struct network_state {
    double tx_re[TAXEL_LINES_MAX], tx_im[TAXEL_LINES_MAX];
    double rx_re[TAXEL_LINES_MAX], rx_im[TAXEL_LINES_MAX];
};

/* Effective capacitances [rx], farad, of the crossings with the driven line. Gauss-Seidel between the two sets of lines until
 * no current would change any more by 1e-7 of the largest. Returns the sweeps that it took. */
int network_solve(struct network *network, int driven, struct network_state *state, double *effective_f);

#endif
