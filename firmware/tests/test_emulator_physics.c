/* From force to raw count: the layer's curve, the front end, and forces interpolated between the records of a stimulus. */
#define _GNU_SOURCE
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include "check.h"
#include "emulator/layer.h"
#include "fake_world.h"

#define NOISE_COUNTS 4.0
#define TAXELS 12u

static struct fake_world fake;

static void the_layers_curve_rises_and_saturates(void)
{
    layer_init();
    CHECK(layer_permittivity_rise(0.0) == 0.0);
    CHECK(layer_permittivity_rise(-1.0) == 0.0);
    double last = 0.0;
    for (double force = 1e-6; force < 1000.0; force *= 1.01) {
        const double rise = layer_permittivity_rise(force);
        CHECK(rise >= last);
        CHECK(force > 300.0 || rise > last);
        last = rise;
    }
    const double full = layer_permittivity_rise(400.0);
    CHECK_BETWEEN((layer_permittivity_rise(50.0) - layer_permittivity_rise(40.0)) / full, 0.0, 0.02);
    CHECK(layer_permittivity_rise(5.0) - layer_permittivity_rise(4.0) < layer_permittivity_rise(1.0));
    CHECK(layer_permittivity_rise(1e9) <= full * 1.0001);
}

static struct front_end front_end;
static struct normals normals;

static void prepare_front_end(double noise_counts)
{
    const struct taxel_scan_settings settings = {160, 40, 1, 16, 96};
    layer_init();
    normals_init(&normals, 3, 0);
    front_end_init(&front_end, TAXELS, noise_counts, &normals);
    front_end_configure(&front_end, &settings, 1.0);
}

static uint16_t convert_at(uint16_t taxel, double force_n)
{
    return front_end_convert(&front_end, taxel, layer_permittivity_rise(force_n));
}

static void counts_fall_with_force(void)
{
    prepare_front_end(0.0);
    for (uint16_t taxel = 0; taxel < TAXELS; taxel++) {
        const uint16_t rest = front_end_convert(&front_end, taxel, 0.0);
        CHECK_BETWEEN(rest, 1000, 6400);
        CHECK(rest - convert_at(taxel, 0.06) >= 5.0 * NOISE_COUNTS);
        uint16_t last = rest;
        for (double force = 0.001; force < 60.0; force *= 1.1) {
            const uint16_t count = convert_at(taxel, force);
            CHECK(count <= last);
            last = count;
        }
        CHECK(last > 0);
    }
}

static void noise_has_the_deviation_that_was_asked_for(void)
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

static void counts_stay_in_range_at_extreme_settings(void)
{
    static const struct taxel_scan_settings extremes[] = {
        {1, 1, 1, 1, 0}, {65535, 1, 255, 255, 65535}, {1, 65535, 1, 1, 0}, {255, 257, 1, 255, 0}, {1, 1, 255, 255, 0}};
    prepare_front_end(1000.0);
    for (size_t i = 0; i < sizeof extremes / sizeof extremes[0]; i++) {
        front_end_configure(&front_end, &extremes[i], 1.0);
        const unsigned largest = (unsigned)extremes[i].sub_conversions * extremes[i].sense_clock_divider;
        CHECK(front_end.conversion_time > 0);
        for (unsigned n = 0; n < 1000; n++) {
            CHECK(convert_at(0, n) <= largest);
        }
    }
}

/* A stream in a file that is gone once it is closed. */
static int stimulus_file(uint32_t kind, const double *times, const float *values, size_t records)
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
    } expected[] = {{0.0, 0.0}, {0.999, 0.0}, {1.0, 2.0}, {1.5, 3.0}, {1.75, 3.5}, {2.0, 10.0}, {3.0, 5.0}, {4.0, 0.0}, {9.0, 0.0}};
    struct stimulus stimulus;
    CHECK_EQUAL(stimulus_open(&stimulus, stimulus_file(STIMULUS_FORCE, times, values, 4), "test", TAXELS, false), 0);
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

static void recorded_counts_come_back_as_they_were(void)
{
    static const double times[] = {0.0, 0.6, 0.9};
    static const float values[] = {100.0f, 200.0f, 5461.0f};
    fake_world_describe(&fake, 1, TAXELS);
    CHECK_EQUAL(fake_world_open(&fake, stimulus_file(STIMULUS_COUNTS, times, values, 3)), 0);
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

static void a_press_is_seen_by_the_host_on_the_right_taxel(void)
{
    static const double times[] = {0.0, 0.69, 0.7};
    static const float values[] = {0.0f, 0.0f, 0.06f};
    uint16_t rest[TAXELS];
    fake_world_describe(&fake, 1, TAXELS);
    fake.description.noise_counts = 0.0;
    CHECK_EQUAL(fake_world_open(&fake, stimulus_file(STIMULUS_FORCE, times, values, 3)), 0);
    CHECK(fake_world_start(&fake));
    memcpy(rest, fake.counts_of[0x20], sizeof rest);
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    int last_drop = 19;
    for (size_t taxel = 0; taxel < TAXELS; taxel++) {
        const int drop = rest[taxel] - fake.counts_of[0x20][taxel];
        CHECK(drop > last_drop); /* taxel i carries i + 1 times 0.06 N */
        last_drop = drop;
    }
    fake_world_close(&fake);
}

int main(void)
{
    RUN(the_layers_curve_rises_and_saturates);
    RUN(counts_fall_with_force);
    RUN(noise_has_the_deviation_that_was_asked_for);
    RUN(counts_stay_in_range_at_extreme_settings);
    RUN(forces_are_interpolated_between_records);
    RUN(recorded_counts_come_back_as_they_were);
    RUN(a_press_is_seen_by_the_host_on_the_right_taxel);
    return check_summary();
}
