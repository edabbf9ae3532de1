/* Electrode crosstalk: the network solver compared with a dense solution, and the effect of contact on other counts. */
#include <complex.h>
#include <math.h>

#include "effects_bench.h"

#define ROWS 6
#define COLUMNS 5
#define TAXELS (ROWS * COLUMNS)
#define SCAN_S 0.01

static struct bench bench;

/* Prepare one board with these effect lines (ended by NULL). */
static void prepare(const char *const *effects)
{
    bench_describe(&bench, 1, ROWS, COLUMNS);
    for (; effects && *effects; effects++) {
        bench_effect(&bench, *effects);
    }
    bench_open(&bench, 0);
}

/* Prepare one board with one effect line. */
static void prepare_one(const char *effect)
{
    const char *const effects[] = {effect, NULL};
    prepare(effects);
}

/* Return the signal in counts relative to the ideal rest count; quantisation lowers it by up to one count. */
static double signal_counts(int taxel)
{
    return bench.max_count - bench.raw[taxel] - bench.rest_count[taxel];
}

static struct network network;

/* Create a network of lines with random crossing capacitances. Resistances in ohm, capacitance between
 * neighbouring lines in farad. */
static void create_network(double tx_ohm, double rx_ohm, double trace_f)
{
    struct random_source random;
    random_init(&random, 9, 9);
    network = (struct network){.tx_count = ROWS,
                               .rx_count = COLUMNS,
                               .tx_ohm = tx_ohm,
                               .rx_ohm = rx_ohm,
                               .omega = 7.5e6,
                               .ground_f = 8e-12,
                               .trace_f = trace_f,
                               .is_changed = true};
    for (int i = 0; i < ROWS; i++) {
        for (int k = 0; k < COLUMNS; k++) {
            network.mutual[i][k] = (i + k) % 7 == 6 ? 0.0 : 1.5e-12 * (1.0 + 0.1 * random_normal(&random));
        }
    }
}

/* Solve the network for one driven TX line; effective_f: effective capacitance (farad) of each RX line. Must converge
 * within 100 iterations. */
static void solve(int driven, double *effective_f)
{
    struct network_state state = {0};
    network.is_changed = true;
    CHECK(network_solve(&network, driven, &state, effective_f) < 100);
}

/* Solve the network for one driven TX line by Gaussian elimination of the node equations of all lines: an independent
 * reference for network_solve(). */
static void solve_dense(int driven, double *effective_f)
{
    const int n = ROWS + COLUMNS;
    double complex a[ROWS + COLUMNS][ROWS + COLUMNS + 1] = {{0}};
    for (int row = 0; row < n; row++) {
        for (int other = 0; other < n; other++) {
            const bool is_crossing = (row < ROWS) != (other < ROWS);
            const int tx = row < ROWS ? row : other, rx = (row < ROWS ? other : row) - ROWS;
            const double farad = row == other            ? network.ground_f
                                 : is_crossing           ? network.mutual[tx][rx]
                                 : abs(row - other) == 1 ? network.trace_f
                                                         : 0.0;
            a[row][row] += I * network.omega * farad;
            if (row != other) {
                a[row][other] -= I * network.omega * farad;
            }
        }
        a[row][row] += 1.0 / (row < ROWS ? network.tx_ohm : network.rx_ohm);
    }
    a[driven][n] = 1.0 / network.tx_ohm;
    for (int i = 0; i < n; i++) {
        for (int row = 0; row < n; row++) {
            const double complex factor = row == i ? 0.0 : a[row][i] / a[i][i];
            for (int k = i; k <= n; k++) {
                a[row][k] -= factor * a[i][k];
            }
        }
    }
    for (int k = 0; k < COLUMNS; k++) {
        effective_f[k] = cimag(a[ROWS + k][n] / a[ROWS + k][ROWS + k]) / network.rx_ohm / network.omega;
    }
}

static void the_network_agrees_with_a_dense_solution(void)
{
    static const double cases[][3] = {{500, 700, 0}, {3000, 100, 0}, {10, 5000, 2e-12}, {4000, 4000, 5e-12}};
    double iterative[COLUMNS], dense[COLUMNS];
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        create_network(cases[n][0], cases[n][1], cases[n][2]);
        for (int driven = 0; driven < ROWS; driven++) {
            solve(driven, iterative);
            solve_dense(driven, dense);
            for (int k = 0; k < COLUMNS; k++) {
                CHECK_BETWEEN((iterative[k] - dense[k]) * 1e12, -3e-7, 3e-7);
            }
        }
    }
}

static void lines_without_resistance_do_not_couple(void)
{
    double effective[COLUMNS];
    create_network(0.0, 0.0, 3e-12);
    solve(2, effective);
    for (int k = 0; k < COLUMNS; k++) {
        CHECK(effective[k] == network.mutual[2][k]);
    }
}

/* Compute the change of each effective capacitance, relative to the added capacitance, when crossing (2, 2) gains 0.2
 * pF. */
static void coupling_changes(double tx_ohm, double rx_ohm, double change[ROWS][COLUMNS])
{
    double before[COLUMNS], after[COLUMNS];
    create_network(tx_ohm, rx_ohm, 0.0);
    for (int i = 0; i < ROWS; i++) {
        network.mutual[2][2] = 1.5e-12;
        solve(i, before);
        network.mutual[2][2] = 1.7e-12;
        solve(i, after);
        for (int k = 0; k < COLUMNS; k++) {
            change[i][k] = (after[k] - before[k]) / 0.2e-12;
        }
    }
}

static void contact_couples_along_the_lines_of_its_taxel(void)
{
    double change[ROWS][COLUMNS], stronger[ROWS][COLUMNS];
    coupling_changes(1500.0, 1500.0, change);
    coupling_changes(3000.0, 3000.0, stronger);
    CHECK_BETWEEN(change[2][2], 0.5, 1.0);
    for (int i = 0; i < ROWS; i++) {
        for (int k = 0; k < COLUMNS; k++) {
            const bool on_a_line = (i == 2) != (k == 2);
            if (on_a_line && network.mutual[i][k] > 0.0) {
                CHECK_BETWEEN(change[i][k], -0.1, -1e-4);
                CHECK(stronger[i][k] < 2.0 * change[i][k]); /* more than proportional to the resistance */
            } else if (!on_a_line && (i != 2 || k != 2)) {
                CHECK_BETWEEN(change[i][k], -0.1 * fabs(change[2][1]), 0.1 * fabs(change[2][1]));
            }
        }
    }
    coupling_changes(1500.0, 0.0, change);
    CHECK(change[2][1] < -1e-4 && fabs(change[1][2]) < 1e-12); /* TX resistance couples along the TX line only */
    coupling_changes(0.0, 1500.0, change);
    CHECK(change[1][2] < -1e-4 && fabs(change[2][1]) < 1e-12);
}

static void contact_couples_equally_to_the_lines_on_both_sides(void)
{
    double first[COLUMNS], second[COLUMNS];
    create_network(2000.0, 2000.0, 0.0);
    for (int i = 0; i < ROWS; i++) {
        for (int k = 0; k < COLUMNS; k++) {
            network.mutual[i][k] = 1.5e-12;
        }
    }
    network.mutual[2][2] = 1.7e-12;
    solve(2, first);
    CHECK_BETWEEN((first[1] - first[3]) * 1e12, -3e-7, 3e-7);
    solve(1, first);
    solve(3, second);
    CHECK_BETWEEN((first[2] - second[2]) * 1e12, -3e-7, 3e-7);
}

static void trace_capacitance_couples_contact_to_the_neighbouring_line(void)
{
    double neighbour_f[2], effective[COLUMNS];
    for (int pressed = 0; pressed < 2; pressed++) {
        create_network(2000.0, 2000.0, 4e-12);
        network.mutual[2][2] += pressed * 0.2e-12;
        solve(2, effective);
        neighbour_f[pressed] = effective[1];
    }
    const double through_traces = neighbour_f[1] - neighbour_f[0];
    for (int pressed = 0; pressed < 2; pressed++) {
        create_network(2000.0, 2000.0, 0.0);
        network.mutual[2][2] += pressed * 0.2e-12;
        solve(2, effective);
        neighbour_f[pressed] = effective[1];
    }
    CHECK(through_traces > neighbour_f[1] - neighbour_f[0] + 1e-15);
}

static void crosstalk_appears_in_the_counts_of_a_coupled_board(void)
{
    uint16_t rest_count[TAXELS];
    prepare_one("coupling resistive tx_ohm=3000 rx_ohm=3000");
    bench_scan(&bench, 0, 0.0);
    memcpy(rest_count, bench.raw, sizeof rest_count);
    double mean = 0.0;
    for (int i = 0; i < TAXELS; i++) {
        mean += signal_counts(i) / bench.rest_count[i] / TAXELS;
        CHECK_BETWEEN(signal_counts(i) / bench.rest_count[i], -0.1, 0.1);
    }
    CHECK_BETWEEN(mean, -0.01, 0.01); /* calibrated */
    bench.rise[2 * COLUMNS + 2] = 1.0;
    bench_scan(&bench, 0, SCAN_S);
    CHECK(rest_count[2 * COLUMNS + 2] > bench.raw[2 * COLUMNS + 2] + 500);
    CHECK(bench.raw[2 * COLUMNS + 1] > rest_count[2 * COLUMNS + 1] + 5);
    CHECK(bench.raw[1 * COLUMNS + 2] > rest_count[1 * COLUMNS + 2] + 5);
    CHECK(abs(bench.raw[0] - rest_count[0]) <= 1);
    bench.rise[2 * COLUMNS + 2] = 0.0;
    bench_scan(&bench, 0, 2.0 * SCAN_S);
    CHECK_BYTES(bench.raw, rest_count, sizeof rest_count);
}

int main(void)
{
    RUN(the_network_agrees_with_a_dense_solution);
    RUN(lines_without_resistance_do_not_couple);
    RUN(contact_couples_along_the_lines_of_its_taxel);
    RUN(contact_couples_equally_to_the_lines_on_both_sides);
    RUN(trace_capacitance_couples_contact_to_the_neighbouring_line);
    RUN(crosstalk_appears_in_the_counts_of_a_coupled_board);
    bench_close(&bench);
    return check_summary();
}
