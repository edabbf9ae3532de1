#include "emulator/effects/network.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define TOLERANCE 1e-7 /* of the largest current: 0.0005 counts */
#define SWEEPS_MAX 500
#define BLOCK 4
#define INLINED __attribute__((always_inline)) /* into each of the two forms of solve() */

typedef double block __attribute__((vector_size(BLOCK * sizeof(double))));

/* 1 / (1 + j reactance): what the sum of a line's currents is multiplied with. */
static inline INLINED void set_share(struct network_lines *share, int line, double reactance)
{
    const double square = 1.0 + reactance * reactance;
    share->re[line] = 1.0 / square;
    share->im[line] = -reactance / square;
}

static inline INLINED void set_shares(struct network *network)
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
        set_share(&network->tx_share, i, network->omega * network->tx_ohm * tx_f);
    }
    for (int k = 0; k < network->rx_count; k++) {
        set_share(&network->rx_share, k, network->omega * network->rx_ohm * rx_f[k]);
    }
}

/* sum += farad * (what the neighbouring lines have) */
static inline INLINED void add_beside(double farad, const double *value, int count, double *sum)
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

/* re, im [out_count] = sum over n of row[n][.] * (value_re[n], value_im[n]), in blocks that a processor keeps in registers. */
static inline INLINED void multiply(const double row[][TAXEL_LINES_MAX], int rows, int out_count, const double *value_re,
                     const double *value_im, double *re, double *im)
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

/* A resistance of 0 holds a line where it is, so RX lines are solved for their current: V = omega rx_ohm * current. */
static inline INLINED double update_rx(const struct network *network, const struct network_lines *share, struct network_state *state,
                        double *largest)
{
    double re[TAXEL_LINES_MAX], im[TAXEL_LINES_MAX];
    const double trace = network->omega * network->rx_ohm * network->trace_f;
    double change = 0.0;
    multiply(network->mutual, network->tx_count, network->rx_count, state->tx_re, state->tx_im, re, im);
    add_beside(trace, state->rx_re, network->rx_count, re);
    add_beside(trace, state->rx_im, network->rx_count, im);
    for (int k = 0; k < network->rx_count; k++) {
        /* j * sum * share */
        const double new_re = -(re[k] * share->im[k] + im[k] * share->re[k]);
        const double new_im = re[k] * share->re[k] - im[k] * share->im[k];
        const double moved = fabs(new_re - state->rx_re[k]) + fabs(new_im - state->rx_im[k]);
        change = moved > change ? moved : change;
        *largest = fabs(new_im) > *largest ? fabs(new_im) : *largest;
        state->rx_re[k] = new_re;
        state->rx_im[k] = new_im;
    }
    return change;
}

static inline INLINED void update_tx(const struct network *network, const struct network_lines *share, struct network_state *state, int driven)
{
    double re[TAXEL_LINES_MAX], im[TAXEL_LINES_MAX];
    const double volt = network->omega * network->rx_ohm, reactance = network->omega * network->tx_ohm;
    multiply(network->transposed, network->rx_count, network->tx_count, state->rx_re, state->rx_im, re, im);
    for (int i = 0; i < network->tx_count; i++) {
        re[i] *= volt;
        im[i] *= volt;
    }
    add_beside(network->trace_f, state->tx_re, network->tx_count, re);
    add_beside(network->trace_f, state->tx_im, network->tx_count, im);
    for (int i = 0; i < network->tx_count; i++) {
        /* (drive + j reactance * sum) * share; the drive below */
        state->tx_re[i] = -reactance * (im[i] * share->re[i] + re[i] * share->im[i]);
        state->tx_im[i] = reactance * (re[i] * share->re[i] - im[i] * share->im[i]);
    }
    state->tx_re[driven] += share->re[driven];
    state->tx_im[driven] += share->im[driven];
}

/* Sweeps converge by a steady factor: what the next ones would still change is known from the last two. */
static inline INLINED bool is_done(double change, double last_change, double tolerance)
{
    const double factor = change < last_change ? change / last_change : 1.0;
    return change <= tolerance || change * factor <= tolerance * (1.0 - factor);
}

static inline INLINED int solve(struct network *network, int driven, struct network_state *state, double *effective_f)
{
    int sweeps = 0;
    double change = 0.0, last_change, largest; /* the first sweep has none to be compared with */
    if (network->changed) {
        set_shares(network);
        network->changed = false;
    }
    do {
        largest = 0.0;
        last_change = change;
        update_tx(network, &network->tx_share, state, driven);
        change = update_rx(network, &network->rx_share, state, &largest);
        sweeps++;
    } while (!is_done(change, last_change, TOLERANCE * largest) && sweeps < SWEEPS_MAX);
    for (int k = 0; k < network->rx_count; k++) {
        effective_f[k] = state->rx_im[k];
    }
    return sweeps;
}

#ifdef __x86_64__
/* The same operations, four at a time where the processor can: the same results to the bit. */
__attribute__((target("avx2"))) static int solve_wide(struct network *network, int driven, struct network_state *state,
                                                      double *effective_f)
{
    return solve(network, driven, state, effective_f);
}
#endif

int network_solve(struct network *network, int driven, struct network_state *state, double *effective_f)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2")) {
        return solve_wide(network, driven, state, effective_f);
    }
#endif
    return solve(network, driven, state, effective_f);
}
