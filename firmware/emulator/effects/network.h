/* Electrical network of a board's lines: capacitances between lines, and resistances to the drivers and to ground.
 *
 * One TX line is driven through tx_ohm with a sine of amplitude 1 at omega; the other TX lines are grounded through
 * tx_ohm. Every RX line is held at the converter's virtual ground through rx_ohm. With node voltages V and capacitances
 * C
 *
 *       (V_i - drive_i) / tx_ohm + j omega (ground + sum_n C_in) V_i = j omega sum_n C_in V_n      (TX lines i)
 *       V_k / rx_ohm + j omega (ground + sum_n C_kn) V_k = j omega sum_n C_kn V_n                  (RX lines k)
 *
 * where n runs over the crossings and the neighbouring lines. RX line k collects I_k = V_k / rx_ohm. The converter is
 * synchronous with the drive and measures the quadrature component: an effective capacitance Im(I_k) / omega, which
 * equals C_dk without resistances. All RX lines are held equally, so one solution serves every RX line of a scan step.
 */
#ifndef EMULATOR_EFFECTS_NETWORK_H
#define EMULATOR_EFFECTS_NETWORK_H

#include <stdbool.h>

#include "generated/taxel_protocol.h"

/* Response of each line to the sum of its currents: 1 / (1 + j omega R C), complex. */
struct network_response {
    double re[TAXEL_LINES_MAX], im[TAXEL_LINES_MAX];
};

struct network {
    int tx_count, rx_count;
    double tx_ohm, rx_ohm, omega;                    /* ohm, ohm, radian per second */
    double ground_f, trace_f;                        /* of a line to ground; between neighbouring lines; farad */
    double mutual[TAXEL_LINES_MAX][TAXEL_LINES_MAX]; /* [tx][rx] farad; 0 without a taxel */

    bool is_changed; /* parameters changed since the last solution; the members below are then recomputed */
    double transposed[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
    struct network_response tx_response, rx_response;
};

/* Start and result of the iteration; initially zero. RX values are currents divided by omega. */
struct network_state {
    double tx_re[TAXEL_LINES_MAX], tx_im[TAXEL_LINES_MAX];
    double rx_re[TAXEL_LINES_MAX], rx_im[TAXEL_LINES_MAX];
};

/* Compute the effective capacitances [rx], farad, of the crossings with the driven line: Gauss-Seidel iteration between
 * the two sets of lines until every current changes by less than 1e-7 of the largest. Returns the number of iterations.
 */
int network_solve(struct network *network, int driven, struct network_state *state, double *effective_f);

#endif
