#include "emulator/effects/network.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define TOLERANCE 1e-7 /* of the largest current: 0.0005 counts */
#define ITERATIONS_MAX 500
#define BLOCK 4
#define ALWAYS_INLINE __attribute__((always_inline)) /* inlined into both variants of solve() */

typedef double block __attribute__((vector_size(BLOCK * sizeof(double))));

/* Set the complex response of a line to the sum of its currents: 1 / (1 + j reactance), where reactance = omega R C. */
static inline ALWAYS_INLINE void set_response(struct network_response *response, int line, double reactance)
{
    const double square = 1.0 + reactance * reactance;
    response->re[line] = 1.0 / square;
    response->im[line] = -reactance / square;
}

/* Compute, from the total capacitance of each line, its response 1 / (1 + j omega R C) to injected current; and the
 * transposed matrix of mutual capacitances, which the update of the TX lines reads. */
static inline ALWAYS_INLINE void set_responses(struct network *network)
{
    double rx_f[TAXEL_LINES_MAX];
    for (int k = 0; k < network->rx_count; k++) {
        rx_f[k] = network->ground_f + network->trace_f * ((k > 0) + (k + 1 < network->rx_count));
    }
    for (int i = 0; i < network->tx_count; i++) {
        double tx_f = network->ground_f + network->trace_f * ((i > 0) + (i + 1 < network->tx_count));
        for (int k = 0; k < network->rx_count; k++) {
            tx_f += network->mutual[i][k];
            rx_f[k] += network->mutual[i][k];
            network->transposed[k][i] = network->mutual[i][k];
        }
        set_response(&network->tx_response, i, network->omega * network->tx_ohm * tx_f);
    }
    for (int k = 0; k < network->rx_count; k++) {
        set_response(&network->rx_response, k, network->omega * network->rx_ohm * rx_f[k]);
    }
}

/* Add the coupling between adjacent traces: sum[i] += farad * (value[i - 1] + value[i + 1]). */
static inline ALWAYS_INLINE void add_neighbours(double farad, const double *value, int count, double *sum)
{
    if (farad == 0.0 || count < 2) {
        return;
    }
    sum[0] += farad * value[1];
    for (int line = 1; line + 1 < count; line++) {
        sum[line] += farad * (value[line - 1] + value[line + 1]);
    }
    sum[count - 1] += farad * value[count - 2];
}

/* Multiply a complex vector by a real matrix: re, im [out_count] = sum over n < rows of row[n][.] * (value_re[n],
 * value_im[n]), in blocks that fit into vector registers. */
static inline ALWAYS_INLINE void multiply(const double row[][TAXEL_LINES_MAX], int rows, int out_count,
                                          const double *value_re, const double *value_im, double *re, double *im)
{
    for (int first = 0; first < out_count; first += BLOCK) {
        block sum_re = {0.0}, sum_im = {0.0}, farad;
        for (int n = 0; n < rows; n++) {
            memcpy(&farad, row[n] + first, sizeof farad);
            sum_re += farad * value_re[n];
            sum_im += farad * value_im[n];
        }
        memcpy(re + first, &sum_re, sizeof sum_re);
        memcpy(im + first, &sum_im, sizeof sum_im);
    }
}

/* Update the currents of all RX lines (divided by omega) from the present TX voltages: a half step of the Gauss-Seidel
 * iteration. RX lines are solved for their currents, V = omega rx_ohm * current, so that a resistance of 0 is allowed.
 * Returns the largest change of a current; raises *largest to the largest quadrature component. */
static inline ALWAYS_INLINE double update_rx(const struct network *network, const struct network_response *response,
                                             struct network_state *state, double *largest)
{
    double re[TAXEL_LINES_MAX], im[TAXEL_LINES_MAX];
    const double trace = network->omega * network->rx_ohm * network->trace_f;
    double change = 0.0;
    multiply(network->mutual, network->tx_count, network->rx_count, state->tx_re, state->tx_im, re, im);
    add_neighbours(trace, state->rx_re, network->rx_count, re);
    add_neighbours(trace, state->rx_im, network->rx_count, im);
    for (int k = 0; k < network->rx_count; k++) {
        /* j * sum * response */
        const double new_re = -(re[k] * response->im[k] + im[k] * response->re[k]);
        const double new_im = re[k] * response->re[k] - im[k] * response->im[k];
        const double step = fabs(new_re - state->rx_re[k]) + fabs(new_im - state->rx_im[k]);
        change = step > change ? step : change;
        *largest = fabs(new_im) > *largest ? fabs(new_im) : *largest;
        state->rx_re[k] = new_re;
        state->rx_im[k] = new_im;
    }
    return change;
}

/* Update the complex voltages of all TX lines from the present RX currents: a half step of the Gauss-Seidel iteration.
 * Line `driven` is driven with amplitude 1; all other TX lines are grounded through their resistance. */
static inline ALWAYS_INLINE void update_tx(const struct network *network, const struct network_response *response,
                                           struct network_state *state, int driven)
{
    double re[TAXEL_LINES_MAX], im[TAXEL_LINES_MAX];
    const double volt = network->omega * network->rx_ohm, reactance = network->omega * network->tx_ohm;
    multiply(network->transposed, network->rx_count, network->tx_count, state->rx_re, state->rx_im, re, im);
    for (int i = 0; i < network->tx_count; i++) {
        re[i] *= volt;
        im[i] *= volt;
    }
    add_neighbours(network->trace_f, state->tx_re, network->tx_count, re);
    add_neighbours(network->trace_f, state->tx_im, network->tx_count, im);
    for (int i = 0; i < network->tx_count; i++) {
        /* (drive + j reactance * sum) * response; the term of the drive is added after the loop */
        state->tx_re[i] = -reactance * (im[i] * response->re[i] + re[i] * response->im[i]);
        state->tx_im[i] = reactance * (re[i] * response->re[i] - im[i] * response->im[i]);
    }
    state->tx_re[driven] += response->re[driven];
    state->tx_im[driven] += response->im[driven];
}

/* Return whether an iteration may end: if its last change, or the sum of all later changes, is at most the tolerance.
 * Iterations converge by a constant factor, so this sum follows from the last two changes. */
static inline ALWAYS_INLINE bool is_converged(double change, double last_change, double tolerance)
{
    const double factor = change < last_change ? change / last_change : 1.0;
    return change <= tolerance || change * factor <= tolerance * (1.0 - factor);
}

/* Solve the network for one driven TX line by Gauss-Seidel iteration from the previous solution in `state`. Writes the
 * effective capacitance (farad) of the driven line to each RX line, which is the quadrature component of the RX current
 * divided by omega; returns the number of iterations. */
static inline ALWAYS_INLINE int solve(struct network *network, int driven, struct network_state *state,
                                      double *effective_f)
{
    int iterations = 0;
    double change = 0.0, last_change, largest; /* the first iteration has no predecessor */
    if (network->is_changed) {
        set_responses(network);
        network->is_changed = false;
    }
    do {
        largest = 0.0;
        last_change = change;
        update_tx(network, &network->tx_response, state, driven);
        change = update_rx(network, &network->rx_response, state, &largest);
        iterations++;
    } while (!is_converged(change, last_change, TOLERANCE * largest) && iterations < ITERATIONS_MAX);
    for (int k = 0; k < network->rx_count; k++) {
        effective_f[k] = state->rx_im[k];
    }
    return iterations;
}

#ifdef __x86_64__
/* The same operations as solve(), compiled for AVX2; the results are bit-identical. */
__attribute__((target("avx2"))) static int solve_wide(struct network *network, int driven, struct network_state *state,
                                                      double *effective_f)
{
    return solve(network, driven, state, effective_f);
}
#endif

/* Solve the network for one driven TX line, with AVX2 instructions if the processor has them. Writes the effective
 * capacitance (farad) of the driven line to each RX line; returns the number of iterations. */
int network_solve(struct network *network, int driven, struct network_state *state, double *effective_f)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2")) {
        return solve_wide(network, driven, state, effective_f);
    }
#endif
    return solve(network, driven, state, effective_f);
}
