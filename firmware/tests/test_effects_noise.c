/* Random effects: standard deviations and correlations. */
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

#define SCANS 4000

static float record[SCANS][TAXELS];

/* Record the raw counts of all taxels in many scans with these effect lines (ended by NULL). */
static void record_noise(const char *const *effects)
{
    prepare(effects);
    for (int scan = 0; scan < SCANS; scan++) {
        bench_scan(&bench, 0, scan * SCAN_S);
        for (int i = 0; i < TAXELS; i++) {
            record[scan][i] = (float)bench.raw[i];
        }
    }
}

/* Return the covariance of two taxels, the second `lag` scans after the first. */
static double covariance(int a, int b, int lag)
{
    double mean_a = 0.0, mean_b = 0.0, sum = 0.0;
    for (int scan = 0; scan + lag < SCANS; scan++) {
        mean_a += (double)record[scan][a] / (SCANS - lag);
        mean_b += (double)record[scan + lag][b] / (SCANS - lag);
    }
    for (int scan = 0; scan + lag < SCANS; scan++) {
        sum += ((double)record[scan][a] - mean_a) * ((double)record[scan + lag][b] - mean_b);
    }
    return sum / (SCANS - lag);
}

/* Return the correlation of two taxels in the recorded scans, the second `lag` scans after the first. */
static double correlation(int a, int b, int lag)
{
    return covariance(a, b, lag) / sqrt(covariance(a, a, 0) * covariance(b, b, 0));
}

/* Record the raw counts of all taxels in many scans with one effect line. */
static void record_effect(const char *effect)
{
    const char *const effects[] = {effect, NULL};
    record_noise(effects);
}

static void white_noise_is_independent_for_each_conversion(void)
{
    record_effect("noise white counts=10");
    CHECK_BETWEEN(sqrt(covariance(3, 3, 0)), 9.5, 10.5);
    CHECK_BETWEEN(correlation(0, 1, 0), -0.08, 0.08);
    CHECK_BETWEEN(correlation(0, 0, 1), -0.08, 0.08);
}

static void line_noise_is_shared_by_a_line_within_a_scan(void)
{
    record_effect("noise line axis=0 counts=10");
    CHECK_BETWEEN(sqrt(covariance(3, 3, 0)), 9.5, 10.5);
    CHECK(correlation(0, COLUMNS - 1, 0) > 0.99);
    CHECK_BETWEEN(correlation(0, COLUMNS, 0), -0.08, 0.08);
    record_effect("noise line axis=1 counts=10");
    CHECK(correlation(0, COLUMNS, 0) > 0.99);
    CHECK_BETWEEN(correlation(0, 1, 0), -0.08, 0.08);
    record_effect("noise line axis=2 counts=10");
    CHECK(correlation(0, TAXELS - 1, 0) > 0.99);
    CHECK_BETWEEN(correlation(0, 0, 1), -0.08, 0.08);
}

static void noise_lines_add_up_independently(void)
{
    static const char *const effects[] = {"noise white counts=6", "noise white counts=8", "noise line axis=2 counts=10",
                                          NULL};
    record_noise(effects);
    CHECK_BETWEEN(sqrt(covariance(0, 0, 0)), 13.2, 15.0);
    CHECK_BETWEEN(correlation(0, 1, 0), 0.43, 0.57);
}

static void pink_noise_falls_with_frequency(void)
{
    record_effect("noise pink counts=20");
    double variance = 0.0, scan_correlation = 0.0, octave_ratio = 0.0;
    double power[4] = {0.0};
    for (int i = 0; i < TAXELS; i++) {
        variance += covariance(i, i, 0) / TAXELS;
        scan_correlation += correlation(i, i, 1) / TAXELS;
        /* lags two octaves apart: 1/f noise loses a constant amount of correlation per octave */
        for (int n = 0; n < 4; n++) {
            power[n] += (covariance(i, i, 0) - covariance(i, i, 4 << (2 * n))) / TAXELS;
        }
    }
    for (int n = 0; n < 3; n++) {
        octave_ratio = fmax(octave_ratio, (power[n + 1] - power[n]) / power[1]);
    }
    CHECK_BETWEEN(sqrt(variance), 15.0, 22.0); /* 40 s do not contain the full variance of the slowest process */
    CHECK_BETWEEN(scan_correlation, 0.75, 0.97);
    CHECK(power[0] < power[1] && power[1] < power[2] && power[2] < power[3]);
    CHECK_BETWEEN(octave_ratio, 0.2, 0.8);
    CHECK_BETWEEN(correlation(0, 1, 0), -0.5, 0.5);
    record_effect("noise pink counts=20 shared=1");
    CHECK(correlation(0, TAXELS - 1, 0) > 0.99);
}

static void impulses_have_the_configured_rate_and_duration(void)
{
    record_effect("noise impulse counts=200 rate_hz=2 duration_ms=50");
    double active_scans = 0.0, events = 0.0, positive = 0.0;
    const double rest_count = bench.max_count - floor(bench.rest_count[0]);
    for (int scan = 1; scan < SCANS; scan++) {
        const double now = (double)record[scan][0] - rest_count, last = (double)record[scan - 1][0] - rest_count;
        CHECK(now == 0.0 || fabs(now) == 200.0);
        active_scans += now != 0.0;
        events += now != 0.0 && last != now;
        positive += now > 0.0;
    }
    CHECK_BETWEEN(active_scans / SCANS, 0.06, 0.14); /* 2 per second, 50 ms each, over 40 s; some overlap */
    CHECK_BETWEEN(events, 50.0, 110.0);
    CHECK_BETWEEN(positive / active_scans, 0.25, 0.75);
}

static void random_drift_has_its_standard_deviation_and_correlation_time(void)
{
    record_effect("drift wander counts=50 seconds=0.2 share=0");
    CHECK_BETWEEN(sqrt(covariance(0, 0, 0)), 42.0, 58.0);
    CHECK_BETWEEN(correlation(0, 0, 20), 0.25, 0.5); /* exp(-1) after 0.2 s */
    CHECK(correlation(0, 7, 0) > 0.99);
}

int main(void)
{
    RUN(white_noise_is_independent_for_each_conversion);
    RUN(line_noise_is_shared_by_a_line_within_a_scan);
    RUN(noise_lines_add_up_independently);
    RUN(pink_noise_falls_with_frequency);
    RUN(impulses_have_the_configured_rate_and_duration);
    RUN(random_drift_has_its_standard_deviation_and_correlation_time);
    bench_close(&bench);
    return check_summary();
}
