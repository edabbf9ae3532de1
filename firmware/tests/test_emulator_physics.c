/* From force to raw count: the curve of the layer, the front end, and the interpolation between the records of a
 * stimulus. */
#define _GNU_SOURCE
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include "check.h"
#include "emulator/physics/layer.h"
#include "fake_world.h"

#define NOISE_COUNTS 4.0
#define TAXELS 12u

static struct fake_world fake;

static void permittivity_rises_with_force_and_saturates(void)
{
    layer_init();
    CHECK(layer_rise_at_force(0.0) == 0.0);
    CHECK(layer_rise_at_force(-1.0) == 0.0);
    double previous = 0.0;
    for (double force = 1e-6; force < 1000.0; force *= 1.01) {
        const double rise = layer_rise_at_force(force);
        CHECK(rise >= previous);
        CHECK(force > 300.0 || rise > previous);
        previous = rise;
    }
    const double saturated = layer_rise_at_force(400.0);
    CHECK_BETWEEN((layer_rise_at_force(50.0) - layer_rise_at_force(40.0)) / saturated, 0.0, 0.02);
    CHECK(layer_rise_at_force(5.0) - layer_rise_at_force(4.0) < layer_rise_at_force(1.0));
    CHECK(layer_rise_at_force(1e9) <= saturated * 1.0001);
}

static struct front_end front_end;
static struct normal_source normals;

/* Prepare a front end with the default scan settings and white noise of this standard deviation in counts. */
static void prepare_front_end(double noise_counts)
{
    const struct taxel_scan_settings settings = {160, 40, 1, 16, 96};
    layer_init();
    normal_source_init(&normals, 3, 0);
    front_end_init(&front_end, TAXELS, noise_counts, &normals);
    front_end_configure(&front_end, &settings, 1.0);
}

/* Return the raw count of a taxel under a force in newtons. */
static uint16_t convert_at(uint16_t taxel, double force_n)
{
    return front_end_convert(&front_end, taxel, layer_rise_at_force(force_n));
}

static void raw_counts_fall_with_force(void)
{
    prepare_front_end(0.0);
    for (uint16_t taxel = 0; taxel < TAXELS; taxel++) {
        const uint16_t rest = front_end_convert(&front_end, taxel, 0.0);
        CHECK_BETWEEN(rest, 1000, 6400);
        CHECK(rest - convert_at(taxel, 0.06) >= 5.0 * NOISE_COUNTS);
        uint16_t previous = rest;
        for (double force = 0.001; force < 60.0; force *= 1.1) {
            const uint16_t count = convert_at(taxel, force);
            CHECK(count <= previous);
            previous = count;
        }
        CHECK(previous > 0);
    }
}

static void noise_has_the_configured_standard_deviation(void)
{
    double sum = 0.0, squares = 0.0;
    const unsigned n = 20000;
    prepare_front_end(NOISE_COUNTS);
    for (unsigned i = 0; i < n; i++) {
        const double count = front_end_convert(&front_end, 0, 0.0);
        sum += count;
        squares += count * count;
    }
    const double deviation = sqrt(squares / n - (sum / n) * (sum / n));
    CHECK_BETWEEN(deviation, NOISE_COUNTS * 0.95, NOISE_COUNTS * 1.05);
}

static void raw_counts_stay_in_range_at_extreme_settings(void)
{
    static const struct taxel_scan_settings extremes[] = {
        {1, 1, 1, 1, 0}, {65535, 1, 255, 255, 65535}, {1, 65535, 1, 1, 0}, {255, 257, 1, 255, 0}, {1, 1, 255, 255, 0}};
    prepare_front_end(1000.0);
    for (size_t i = 0; i < sizeof extremes / sizeof extremes[0]; i++) {
        front_end_configure(&front_end, &extremes[i], 1.0);
        const unsigned max_count = (unsigned)extremes[i].sub_conversions * extremes[i].sense_clock_divider;
        CHECK(front_end.conversion_time > 0);
        for (unsigned n = 0; n < 1000; n++) {
            CHECK(convert_at(0, n) <= max_count);
        }
    }
}

/* Return the descriptor of a stimulus stream in an unlinked temporary file. Taxel i has i + 1 times the value of a
 * record. */
static int create_stimulus(uint32_t kind, const double *times, const float *values, size_t records)
{
    char path[] = "/tmp/taxel_test_XXXXXX";
    uint8_t header[24] = "TAXELSTM";
    const int fd = mkstemp(path);
    unlink(path);
    taxel_put_u32(header + 8, 1);
    taxel_put_u32(header + 12, kind);
    taxel_put_u32(header + 16, TAXELS);
    bool written = write(fd, header, sizeof header) == (ssize_t)sizeof header;
    for (size_t i = 0; i < records; i++) {
        float row[TAXELS];
        for (size_t taxel = 0; taxel < TAXELS; taxel++) {
            row[taxel] = values[i] * (float)(taxel + 1u);
        }
        written = written && write(fd, &times[i], sizeof times[i]) == (ssize_t)sizeof times[i] &&
                  write(fd, row, sizeof row) == (ssize_t)sizeof row;
    }
    CHECK(written);
    lseek(fd, 0, SEEK_SET);
    return fd;
}

static void forces_are_interpolated_between_records(void)
{
    static const double times[] = {1.0, 2.0, 2.0, 4.0};
    static const float values[] = {2.0f, 4.0f, 10.0f, 0.0f};
    static const struct {
        double time, value;
    } expected[] = {{0.0, 0.0},  {0.999, 0.0}, {1.0, 2.0}, {1.5, 3.0}, {1.75, 3.5},
                    {2.0, 10.0}, {3.0, 5.0},   {4.0, 0.0}, {9.0, 0.0}};
    struct stimulus stimulus;
    CHECK_EQUAL(stimulus_open(&stimulus, create_stimulus(STIMULUS_FORCE, times, values, 4), "test", TAXELS, false), 0);
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
        const vtime time = (vtime)(expected[i].time * (double)VTIME_SECOND);
        while (stimulus.until <= time) {
            CHECK_EQUAL(stimulus_advance(&stimulus, stimulus.until), 0);
        }
        for (size_t taxel = 0; taxel < TAXELS; taxel++) {
            CHECK_BETWEEN(stimulus_value(&stimulus, taxel, time) / (double)(taxel + 1u), expected[i].value - 1e-6,
                          expected[i].value + 1e-6);
        }
    }
    stimulus_close(&stimulus);
}

/* Taxel i has i + 1 times the recorded value. */
static void recorded_counts_are_delivered_unchanged(void)
{
    static const double times[] = {0.0, 0.6, 0.9};
    static const float values[] = {100.0f, 200.0f, 5461.0f};
    fake_world_describe(&fake, 1, TAXELS);
    CHECK_EQUAL(fake_world_open(&fake, create_stimulus(STIMULUS_COUNTS, times, values, 3)), 0);
    CHECK(fake_world_start(&fake));
    for (size_t i = 0; i < 2; i++) {
        for (uint16_t taxel = 0; taxel < TAXELS; taxel++) {
            CHECK_EQUAL(fake.counts_of[0x20][taxel], (unsigned)values[i] * (taxel + 1u));
        }
        CHECK_EQUAL(fake_world_run(&fake, 0.2), 0);
    }
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    CHECK_EQUAL(fake.counts_of[0x20][11], 65532);
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
}

static void a_taxel_with_a_larger_force_has_a_larger_signal(void)
{
    static const double times[] = {0.0, 0.69, 0.7};
    static const float values[] = {0.0f, 0.0f, 0.06f};
    uint16_t rest[TAXELS];
    fake_world_describe(&fake, 1, TAXELS);
    fake.description.noise_counts = 0.0;
    CHECK_EQUAL(fake_world_open(&fake, create_stimulus(STIMULUS_FORCE, times, values, 3)), 0);
    CHECK(fake_world_start(&fake));
    memcpy(rest, fake.counts_of[0x20], sizeof rest);
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    int previous_signal = 19;
    for (size_t taxel = 0; taxel < TAXELS; taxel++) {
        const int signal_counts = rest[taxel] - fake.counts_of[0x20][taxel];
        CHECK(signal_counts > previous_signal); /* taxel i carries i + 1 times 0.06 N */
        previous_signal = signal_counts;
    }
    fake_world_close(&fake);
}

int main(void)
{
    RUN(permittivity_rises_with_force_and_saturates);
    RUN(raw_counts_fall_with_force);
    RUN(noise_has_the_configured_standard_deviation);
    RUN(raw_counts_stay_in_range_at_extreme_settings);
    RUN(forces_are_interpolated_between_records);
    RUN(recorded_counts_are_delivered_unchanged);
    RUN(a_taxel_with_a_larger_force_has_a_larger_signal);
    return check_summary();
}
