/* Effects that are random in time: their deviations, and what is correlated with what. */
#include <math.h>

#include "effects_bench.h"

#define ROWS 6
#define COLUMNS 5
#define TAXELS (ROWS * COLUMNS)
#define SCAN_S 0.01

static struct bench bench;

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

/* Covariance of two taxels, the second `later` scans after the first. */
static double covariance(int a, int b, int later)
{
    double mean_a = 0.0, mean_b = 0.0, sum = 0.0;
    for (int scan = 0; scan + later < SCANS; scan++) {
        mean_a += (double)record[scan][a] / (SCANS - later);
        mean_b += (double)record[scan + later][b] / (SCANS - later);
    }
    for (int scan = 0; scan + later < SCANS; scan++) {
        sum += ((double)record[scan][a] - mean_a) * ((double)record[scan + later][b] - mean_b);
    }
    return sum / (SCANS - later);
}

static double correlation(int a, int b, int later)
{
    return covariance(a, b, later) / sqrt(covariance(a, a, 0) * covariance(b, b, 0));
}

static void record_one(const char *effect)
{
    const char *const effects[] = {effect, NULL};
    record_noise(effects);
}

static void white_noise_is_of_each_conversion(void)
{
    record_one("noise white counts=10");
    CHECK_BETWEEN(sqrt(covariance(3, 3, 0)), 9.5, 10.5);
    CHECK_BETWEEN(correlation(0, 1, 0), -0.08, 0.08);
    CHECK_BETWEEN(correlation(0, 0, 1), -0.08, 0.08);
}

static void line_noise_is_common_to_a_line_of_a_scan(void)
{
    record_one("noise line axis=0 counts=10");
    CHECK_BETWEEN(sqrt(covariance(3, 3, 0)), 9.5, 10.5);
    CHECK(correlation(0, COLUMNS - 1, 0) > 0.99);
    CHECK_BETWEEN(correlation(0, COLUMNS, 0), -0.08, 0.08);
    record_one("noise line axis=1 counts=10");
    CHECK(correlation(0, COLUMNS, 0) > 0.99);
    CHECK_BETWEEN(correlation(0, 1, 0), -0.08, 0.08);
    record_one("noise line axis=2 counts=10");
    CHECK(correlation(0, TAXELS - 1, 0) > 0.99);
    CHECK_BETWEEN(correlation(0, 0, 1), -0.08, 0.08);
}

static void slots_add_up_as_independent_noise(void)
{
    static const char *const effects[] = {"noise white counts=6", "noise white counts=8", "noise line axis=2 counts=10", NULL};
    record_noise(effects);
    CHECK_BETWEEN(sqrt(covariance(0, 0, 0)), 13.2, 15.0);
    CHECK_BETWEEN(correlation(0, 1, 0), 0.43, 0.57);
}

static void pink_noise_falls_with_frequency(void)
{
    record_one("noise pink counts=20");
    double variance = 0.0, near = 0.0, octave_ratio = 0.0;
    double power[4] = {0.0};
    for (int i = 0; i < TAXELS; i++) {
        variance += covariance(i, i, 0) / TAXELS;
        near += correlation(i, i, 1) / TAXELS;
        for (int n = 0; n < 4; n++) { /* lags of octaves: 1/f loses a steady amount of correlation from each to the next */
            power[n] += (covariance(i, i, 0) - covariance(i, i, 4 << (2 * n))) / TAXELS;
        }
    }
    for (int n = 0; n < 3; n++) {
        octave_ratio = fmax(octave_ratio, (power[n + 1] - power[n]) / power[1]);
    }
    CHECK_BETWEEN(sqrt(variance), 15.0, 22.0); /* the slowest process does not show all of itself in 40 s */
    CHECK_BETWEEN(near, 0.75, 0.97);
    CHECK(power[0] < power[1] && power[1] < power[2] && power[2] < power[3]);
    CHECK_BETWEEN(octave_ratio, 0.2, 0.8);
    CHECK_BETWEEN(correlation(0, 1, 0), -0.5, 0.5);
    record_one("noise pink counts=20 shared=1");
    CHECK(correlation(0, TAXELS - 1, 0) > 0.99);
}

static void impulses_come_at_their_rate_and_last(void)
{
    record_one("noise impulse counts=200 rate_hz=2 duration_ms=50");
    double with = 0.0, events = 0.0, positive = 0.0;
    const double rest = bench.largest - floor(bench.rest[0]);
    for (int scan = 1; scan < SCANS; scan++) {
        const double now = (double)record[scan][0] - rest, last = (double)record[scan - 1][0] - rest;
        CHECK(now == 0.0 || fabs(now) == 200.0);
        with += now != 0.0;
        events += now != 0.0 && last != now;
        positive += now > 0.0;
    }
    CHECK_BETWEEN(with / SCANS, 0.06, 0.14); /* 2 a second, 50 ms each, over 40 s; some overlap */
    CHECK_BETWEEN(events, 50.0, 110.0);
    CHECK_BETWEEN(positive / with, 0.25, 0.75);
}

static void wandering_has_its_deviation_and_its_memory(void)
{
    record_one("drift wander counts=50 seconds=0.2 share=0");
    CHECK_BETWEEN(sqrt(covariance(0, 0, 0)), 42.0, 58.0);
    CHECK_BETWEEN(correlation(0, 0, 20), 0.25, 0.5); /* exp(-1) after 0.2 s */
    CHECK(correlation(0, 7, 0) > 0.99);
}

int main(void)
{
    RUN(white_noise_is_of_each_conversion);
    RUN(line_noise_is_common_to_a_line_of_a_scan);
    RUN(slots_add_up_as_independent_noise);
    RUN(pink_noise_falls_with_frequency);
    RUN(impulses_come_at_their_rate_and_last);
    RUN(wandering_has_its_deviation_and_its_memory);
    bench_close(&bench);
    return check_summary();
}
