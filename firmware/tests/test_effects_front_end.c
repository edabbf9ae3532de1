/* Effects between capacitance and count on one board; each test states one physical property. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <math.h>
#include <unistd.h>

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

static void electrode_gain_is_log_normal_and_leaves_the_fixed_capacitance(void)
{
    double sum = 0.0, squares = 0.0, n = 0.0;
    for (uint64_t seed = 1; seed <= 40; seed++) {
        bench_describe(&bench, 1, ROWS, COLUMNS);
        bench.world.seed = seed;
        bench_open(&bench, 0);
        const struct front_end ideal = bench.front_end;
        bench_effect(&bench, "gain electrode log_std=0.2 factor=1.5");
        bench_open(&bench, 0);
        for (int i = 0; i < TAXELS; i++) {
            const double log_gain = log(bench.front_end.taxels[i].fringe_f / ideal.taxels[i].fringe_f);
            CHECK(bench.front_end.taxels[i].fixed_f == ideal.taxels[i].fixed_f);
            sum += log_gain;
            squares += log_gain * log_gain;
            n += 1.0;
        }
    }
    CHECK_BETWEEN(sum / n, log(1.5) - 0.02, log(1.5) + 0.02);
    CHECK_BETWEEN(sqrt(squares / n - (sum / n) * (sum / n)), 0.19, 0.21);
}

/* Only board number 1, at 0x21, has the effect. */
static void idac_gain_scales_rest_count_and_signal_equally(void)
{
    bench_describe(&bench, 2, ROWS, COLUMNS);
    bench_open(&bench, 1);
    const double rest_count = bench.rest_count[4];
    const double swing = front_end_hardware_count(&bench.front_end, 4, 1.0) - rest_count;
    bench_effect(&bench, "gain idac board=0x21 factor=0.9");
    bench_open(&bench, 1);
    CHECK_BETWEEN(bench.rest_count[4] / rest_count, 0.9 - 1e-9, 0.9 + 1e-9);
    CHECK_BETWEEN((front_end_hardware_count(&bench.front_end, 4, 1.0) - bench.rest_count[4]) / swing, 0.9 - 1e-9,
                  0.9 + 1e-9);
    bench_open(&bench, 0);
    CHECK(bench.front_end.idac_gain == 1.0);
}

static void warm_up_drift_approaches_its_amplitude_and_differs_between_taxels(void)
{
    double values[4], end = 0.0;
    static const double times[] = {0.0, 10.0, 20.0, 400.0};
    prepare_one("drift warm_up counts=100 seconds=10 share=0");
    for (int n = 0; n < 4; n++) {
        bench_scan(&bench, 0, times[n]);
        values[n] = end = signal_counts(0);
    }
    CHECK_BETWEEN(values[0], -1.0, 1.0);
    CHECK_BETWEEN(end, 30.0, 300.0); /* 100 exp(0.3 n) */
    CHECK_BETWEEN(values[1] / end, 0.632 - 0.02, 0.632 + 0.02);
    CHECK_BETWEEN(values[2] / end, 0.865 - 0.02, 0.865 + 0.02);
    prepare_one("drift warm_up counts=100 seconds=10 share=0.5");
    bench_scan(&bench, 0, 400.0);
    CHECK(fabs(signal_counts(0) - signal_counts(1)) > 2.0);
}

static void saturation_clips_or_compresses_the_signal(void)
{
    prepare_one("saturation clip counts=300");
    bench.rise[3] = 5.0;
    bench.rise[4] = 0.1;
    bench_scan(&bench, 0, 0.0);
    CHECK_BETWEEN(signal_counts(3), 299.0, 300.0);
    CHECK_BETWEEN(signal_counts(4) - 0.1 * bench.front_end.taxels[4].fringe_f * bench.front_end.counts_per_farad, -1.0,
                  0.0);
    CHECK_BETWEEN(signal_counts(5), -1.0, 0.0);
    prepare_one("saturation soft counts=300");
    bench.rise[3] = 300.0 / (bench.front_end.taxels[3].fringe_f * bench.front_end.counts_per_farad);
    bench_scan(&bench, 0, 0.0);
    CHECK_BETWEEN(signal_counts(3), 149.0, 150.0);
    bench.rise[3] *= 0.01;
    bench_scan(&bench, 0, 0.0);
    CHECK_BETWEEN(signal_counts(3), 1.9, 3.0);
}

/* Taxel 3 is detached from the layer and taxel 4 is stuck; all taxels are pressed. */
static void a_dead_taxel_returns_its_rest_count_or_a_stuck_count(void)
{
    static const char *const effects[] = {"dead rest board=0x20 taxel=3", "dead stuck board=0x20 taxel=4 value=777",
                                          NULL};
    prepare(effects);
    for (int i = 0; i < TAXELS; i++) {
        bench.rise[i] = 0.5;
    }
    bench_scan(&bench, 0, 0.0);
    CHECK_BETWEEN(signal_counts(3), -1.0, 0.0);
    CHECK_EQUAL(bench.raw[4], 777);
    CHECK(signal_counts(2) > 100.0 && signal_counts(5) > 100.0);
}

static void an_open_line_affects_only_its_own_taxels(void)
{
    for (int axis = 0; axis < 2; axis++) {
        uint16_t pressed[TAXELS];
        prepare_one(axis ? "line open board=0x20 axis=1 index=2" : "line open board=0x20 axis=0 index=2");
        for (int n = 0; n < 2; n++) {
            for (int i = 0; i < TAXELS; i++) {
                bench.rise[i] = n ? 0.0 : 0.5;
            }
            bench_scan(&bench, 0, n * SCAN_S);
            if (n == 0) {
                memcpy(pressed, bench.raw, sizeof pressed);
            }
        }
        for (int i = 0; i < TAXELS; i++) {
            const bool is_silent = (axis ? i % COLUMNS : i / COLUMNS) == 2;
            CHECK(is_silent ? pressed[i] == bench.raw[i] && bench.raw[i] > 0.95 * bench.max_count
                            : bench.raw[i] - pressed[i] > 100);
        }
    }
}

static void short_circuited_lines_measure_the_mean_of_their_crossings(void)
{
    prepare_one("line short board=0x20 axis=0 index=1");
    bench.rise[1 * COLUMNS + 3] = 0.5;
    for (int n = 0; n < 3; n++) { /* the result must not change from scan to scan */
        bench_scan(&bench, 0, n * SCAN_S);
    }
    for (int k = 0; k < COLUMNS; k++) {
        CHECK_EQUAL(bench.raw[COLUMNS + k], bench.raw[2 * COLUMNS + k]);
    }
    const double swing = 0.5 * bench.front_end.taxels[8].fringe_f * bench.front_end.counts_per_farad;
    const double mean = 0.5 * (bench.rest_count[COLUMNS + 3] + bench.rest_count[2 * COLUMNS + 3] + swing);
    CHECK_BETWEEN(bench.max_count - bench.raw[2 * COLUMNS + 3] - mean, -1.0, 0.0);
    CHECK_BETWEEN(signal_counts(0), -1.0, 0.0);
}

static void a_lagging_count_follows_a_step_with_its_time_constant(void)
{
    prepare_one("late lag seconds=0.2");
    bench_scan(&bench, 0, 0.0);
    bench.rise[0] = 1.0;
    bench_scan(&bench, 0, 0.001);
    const double full = bench.front_end.taxels[0].fringe_f * bench.front_end.counts_per_farad;
    bench_scan(&bench, 0, 0.201);
    CHECK_BETWEEN(signal_counts(0) / full, 0.61, 0.65);
    bench_scan(&bench, 0, 3.0);
    CHECK_BETWEEN(signal_counts(0) / full, 0.99, 1.0);
    CHECK_BETWEEN(signal_counts(1), -1.0, 0.0);
}

static void stuck_bits_have_their_fixed_value(void)
{
    static const char *const effects[] = {"stuck_bit low bit=3", "stuck_bit high bit=0", NULL};
    uint16_t ideal[TAXELS];
    prepare(NULL);
    bench_scan(&bench, 0, 0.0);
    memcpy(ideal, bench.raw, sizeof ideal);
    prepare(effects);
    bench_scan(&bench, 0, 0.0);
    for (int i = 0; i < TAXELS; i++) {
        CHECK_EQUAL(bench.raw[i], (ideal[i] & ~8) | 1);
    }
}

static void exchanged_lines_swap_their_taxels(void)
{
    uint16_t ideal[TAXELS];
    prepare(NULL);
    bench.rise[1] = 0.7;
    bench_scan(&bench, 0, 0.0);
    memcpy(ideal, bench.raw, sizeof ideal);
    prepare_one("exchange lines board=0x20 axis=1 index=1 other=3");
    bench.rise[1] = 0.7;
    bench_scan(&bench, 0, 0.0);
    for (int i = 0; i < TAXELS; i++) {
        const int k = i % COLUMNS;
        CHECK(abs(bench.raw[i] - ideal[k == 1 ? i + 2 : k == 3 ? i - 2 : i]) <= 1);
    }
}

/* The relative fall is resistance x TX clock x added capacitance; after one time constant, 63 % of the reference's
 * fall. */
static void load_lowers_counts_by_the_supply_and_raises_them_by_the_reference(void)
{
    prepare_one("droop supply ohms=1000");
    bench.loads.all_before = bench.loads.all_after = 10e-12;
    bench_scan(&bench, 0, 0.0);
    const double fall = 1000.0 * 1.2e6 * 10e-12;
    CHECK_BETWEEN(signal_counts(0) / bench.rest_count[0], -fall - 1e-3, -fall);
    prepare_one("droop reference ohms=1000 seconds=0.1");
    bench_scan(&bench, 0, 0.0);
    CHECK_BETWEEN(signal_counts(0), -1.0, 0.0);
    bench.loads.before[0] = bench.loads.after[0] = 10e-12;
    bench_scan(&bench, 0, 0.001);
    bench_scan(&bench, 0, 0.101);
    CHECK_BETWEEN(signal_counts(0) / bench.rest_count[0], 0.6 * fall, 0.68 * fall);
    bench_scan(&bench, 0, 2.0);
    CHECK_BETWEEN(signal_counts(0) / bench.rest_count[0], 0.98 * fall, 1.03 * fall);
}

static void a_nonlinear_converter_has_a_plateau_at_one_half_or_a_bow(void)
{
    struct nonlinear_effect nonlinear = {0};
    unsigned at_half = 0;
    nonlinear.leak[0] = 0.004;
    for (double count = 3150.0; count < 3250.0; count += 0.5) {
        at_half += nonlinear_count(&nonlinear, 0, 6400.0, count) == 3200.0;
    }
    CHECK_BETWEEN(at_half * 0.5, 12.0, 13.5); /* 6400 * leak / 2 */
    nonlinear.leak[0] = 0.0;
    nonlinear.bow_counts[0] = 20.0;
    CHECK_BETWEEN(nonlinear_count(&nonlinear, 0, 6400.0, 3200.0) - 3200.0, 19.999, 20.001);
    CHECK_BETWEEN(nonlinear_count(&nonlinear, 0, 6400.0, 0.0), -1e-9, 1e-9);
    CHECK(nonlinear_count(&nonlinear, 0, 6400.0, 1600.0) - 1600.0 >
          nonlinear_count(&nonlinear, 0, 6400.0, 4800.0) - 4800.0);
}

static void invalid_effect_lines_are_rejected(void)
{
    static const char *const invalid[] = {"coupling resistive tx_ohm=-1",
                                          "coupling traces",
                                          "noise line counts=1",
                                          "noise line axis=3 counts=1",
                                          "noise brown counts=1",
                                          "gain idac factor=0",
                                          "drift wander counts=1",
                                          "saturation clip counts=0",
                                          "dead rest board=0x20 taxel=30",
                                          "dead rest taxel=1",
                                          "line open board=0x20 axis=0 index=6",
                                          "line short board=0x20 axis=1 index=4",
                                          "silent flaky p=0.9 burst=2",
                                          "silent from seconds=1",
                                          "late delay seconds=9",
                                          "clock wander ppm=3",
                                          "exchange boards board=0x20 other=0x20",
                                          "exchange boards board=0x20 other=0x2F",
                                          "stuck_bit low bit=16",
                                          "droop supply",
                                          "nonlinear bow counts=1 leak=1"};
    bench_describe(&bench, 1, ROWS, COLUMNS);
    const int saved = dup(2), null_device = open("/dev/null", O_WRONLY);
    dup2(null_device, 2);
    close(null_device);
    for (size_t i = 0; i < sizeof invalid / sizeof invalid[0]; i++) {
        CHECK_EQUAL(read_effect(&bench.world, invalid[i]), -1);
    }
    for (int i = 0; i < NOISE_SLOTS_MAX; i++) {
        CHECK_EQUAL(read_effect(&bench.world, "noise white counts=1"), 0);
    }
    CHECK_EQUAL(read_effect(&bench.world, "noise white counts=1"), -1);
    dup2(saved, 2);
    close(saved);
}

int main(void)
{
    RUN(electrode_gain_is_log_normal_and_leaves_the_fixed_capacitance);
    RUN(idac_gain_scales_rest_count_and_signal_equally);
    RUN(warm_up_drift_approaches_its_amplitude_and_differs_between_taxels);
    RUN(saturation_clips_or_compresses_the_signal);
    RUN(a_dead_taxel_returns_its_rest_count_or_a_stuck_count);
    RUN(an_open_line_affects_only_its_own_taxels);
    RUN(short_circuited_lines_measure_the_mean_of_their_crossings);
    RUN(a_lagging_count_follows_a_step_with_its_time_constant);
    RUN(stuck_bits_have_their_fixed_value);
    RUN(exchanged_lines_swap_their_taxels);
    RUN(load_lowers_counts_by_the_supply_and_raises_them_by_the_reference);
    RUN(a_nonlinear_converter_has_a_plateau_at_one_half_or_a_bow);
    RUN(invalid_effect_lines_are_rejected);
    bench_close(&bench);
    return check_summary();
}
