/* Each effect of the skin by its physics. */
#include <math.h>

#include "skin_bench.h"

#define MIDDLE 27u /* TX 3, RX 3 */
#define FORCE_N 0.5

static struct skin_bench bench;

static double total_force(void)
{
    double sum = 0.0;
    for (size_t i = 0; i < bench.patch.taxel_count; i++) {
        sum += bench.fields[i].force;
    }
    return sum;
}

static void a_film_keeps_the_force(void)
{
    static const double at[] = {0, 7, 27, 63};
    for (size_t i = 0; i < 4; i++) {
        bench_open(&bench, "spread film length_m=0.003", -1);
        bench_press(&bench, (size_t)at[i], FORCE_N, 0.01, false);
        CHECK(fabs(total_force() / FORCE_N - 1.0) < 1e-9);
        CHECK(bench.fields[(size_t)at[i]].force < FORCE_N);
        bench_close(&bench);
    }
}

static void a_films_kernel_falls_to_1_over_e_at_its_length(void)
{
    bench_open(&bench, "spread film length_m=0.00375", -1); /* 3 cells */
    double pressure[BENCH_CELLS] = {0.0};
    const int columns = bench.patch.grid_columns, source = 12 * columns + 12;
    pressure[bench.patch.cell_at[source]] = 1000.0;
    spread_pressure(&bench.field.spread, &bench.world.effects.spread, &bench.patch, pressure);
    for (int away = 0; away < 9; away++) {
        const double here = pressure[bench.patch.cell_at[source + away]], there = pressure[bench.patch.cell_at[source + away + 3]];
        CHECK(fabs(there / here - exp(-1.0)) < 1e-12);
        CHECK(fabs(pressure[bench.patch.cell_at[source + columns * (away + 3)]] / there - 1.0) < 1e-12);
    }
    bench_close(&bench);
}

static void nothing_gets_past_a_hole(void)
{
    const int columns = BENCH_LINES * CELLS_PER_SIDE;
    bench_open(&bench, "spread film length_m=0.00375", (int)MIDDLE);
    double pressure[BENCH_CELLS] = {0.0};
    pressure[bench.patch.cell_at[12 * columns + 11]] = 1000.0; /* left of the hole */
    spread_pressure(&bench.field.spread, &bench.world.effects.spread, &bench.patch, pressure);
    double beyond = 0.0, around = 0.0;
    for (int column = 16; column < columns; column++) {
        beyond += pressure[bench.patch.cell_at[12 * columns + column]];
        around += pressure[bench.patch.cell_at[11 * columns + column]];
    }
    CHECK(beyond == 0.0 && around == 0.0); /* along its row, and then down the columns that it has reached */
    CHECK(pressure[bench.patch.cell_at[16 * columns + 11]] > 0.0);
    bench_close(&bench);
}

static double pressed_cells(double slope)
{
    char line[64];
    unsigned pressed = 0;
    snprintf(line, sizeof line, "spread pillars slope=%g", slope);
    bench_open(&bench, line, -1);
    memset(bench.compression, 0, sizeof bench.compression);
    bench.compression[16 * MIDDLE] = 0.0004;
    spread_compression(&bench.field.spread, &bench.world.effects.spread, &bench.patch, bench.compression);
    for (size_t i = 0; i < BENCH_CELLS; i++) {
        pressed += bench.compression[i] > 0.0;
        CHECK(bench.compression[i] <= 0.0004);
    }
    CHECK(bench.compression[16 * MIDDLE] == 0.0004);
    CHECK(fabs(bench.compression[16 * MIDDLE + 1] - fmax(0.0, 0.0004 - slope * CELL_SIDE_M)) < 1e-15);
    bench_close(&bench);
    return pressed;
}

static void pillars_grow_the_patch_the_more_the_gentler_they_slope(void)
{
    const double steep = pressed_cells(1.0), mid = pressed_cells(0.2), gentle = pressed_cells(0.05);
    CHECK(steep == 1.0);
    CHECK(mid > steep && gentle > mid);
}

static void forces_spread_by_pillars_too(void)
{
    bench_open(&bench, "spread pillars slope=0.05", -1);
    bench_press(&bench, MIDDLE, FORCE_N, 0.01, false);
    CHECK(bench.fields[MIDDLE].rise > bench.fields[MIDDLE + 1].rise && bench.fields[MIDDLE + 1].rise > 0.0);
    CHECK(bench.fields[0].rise == 0.0);
    bench_close(&bench);
}

/* Rise of the pressed taxel after a press held for a time. */
static double held(const char *line, double seconds)
{
    bench_open(&bench, line, -1);
    bench_press(&bench, MIDDLE, FORCE_N, 0.0, true);
    if (seconds > 0.0) {
        bench_press(&bench, MIDDLE, FORCE_N, seconds, false);
    }
    const double rise = bench.fields[MIDDLE].rise;
    bench_close(&bench);
    return rise;
}

static void a_solid_creeps_to_the_layers_own_curve_and_recovers(void)
{
    const char *line = "rheology solid fraction=0.3 seconds=2";
    const double full = layer_pressure_rise(FORCE_N / 25e-6), c = layer_compression(FORCE_N / 25e-6);
    CHECK(fabs(held(line, 0.0) / layer_compression_rise(0.7 * c) - 1.0) < 1e-4);
    CHECK(fabs(held(line, 2.0) / layer_compression_rise((1.0 - 0.3 * exp(-1.0)) * c) - 1.0) < 1e-4);
    CHECK(fabs(held(line, 100.0) / full - 1.0) < 1e-4);
    bench_open(&bench, line, -1);
    bench_press(&bench, MIDDLE, FORCE_N, 0.0, true);
    bench_press(&bench, MIDDLE, FORCE_N, 100.0, false);
    bench_press(&bench, MIDDLE, 0.0, 0.0, true);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_compression_rise(0.3 * c) - 1.0) < 1e-9);
    bench_press(&bench, MIDDLE, 0.0, 2.0, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_compression_rise(0.3 * exp(-1.0) * c) - 1.0) < 1e-9);
    CHECK(field_is_awake(&bench.field, bench.time));
    bench_press(&bench, MIDDLE, 0.0, 100.0, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0);
    CHECK(!field_is_awake(&bench.field, bench.time));
    bench_close(&bench);
}

/* One long step or many short ones: the same, to rounding. */
static void rheology_does_not_depend_on_the_records_spacing(void)
{
    static const char *const lines[] = {"rheology solid fraction=0.3 seconds=0.7",
                                        "rheology play fraction=0.4 width_m=1e-4 creep=0.2 seconds=0.7"};
    for (size_t i = 0; i < 2; i++) {
        double rise[2];
        for (int fine = 0; fine < 2; fine++) {
            const int steps = fine ? 500 : 1;
            bench_open(&bench, lines[i], -1);
            bench_press(&bench, MIDDLE, FORCE_N, 0.0, true);
            for (int n = 0; n < steps; n++) {
                bench_press(&bench, MIDDLE, FORCE_N, 3.0 / steps, false);
            }
            rise[fine] = bench.fields[MIDDLE].rise;
            bench_close(&bench);
        }
        CHECK(fabs(rise[1] / rise[0] - 1.0) < 1e-9);
    }
}

static void sticking_pillars_make_a_loop_that_ignores_the_rate(void)
{
    static const double rates[] = {0.01, 10.0};
    double up[2], down[2];
    for (int i = 0; i < 2; i++) {
        bench_open(&bench, "rheology play fraction=0.5 width_m=1e-4 seconds=1", -1);
        bench_press(&bench, MIDDLE, 0.4, rates[i], false);
        up[i] = bench.fields[MIDDLE].rise;
        bench_press(&bench, MIDDLE, 1.0, rates[i], false);
        bench_press(&bench, MIDDLE, 0.4, rates[i], false);
        down[i] = bench.fields[MIDDLE].rise;
        bench_press(&bench, MIDDLE, 0.0, rates[i], false);
        CHECK(bench.fields[MIDDLE].rise == 0.0); /* no load, no lag */
        bench_close(&bench);
    }
    CHECK(up[0] == up[1] && down[0] == down[1]);
    CHECK(down[0] > 1.02 * up[0]);
    CHECK(down[0] <= layer_pressure_rise(0.4 / 25e-6) * (1.0 + 1e-4));
}

static void plays_creep_goes_on_over_decades(void)
{
    const char *line = "rheology play fraction=0 width_m=1e-4 creep=0.3 seconds=1";
    double last = held(line, 0.0);
    for (double seconds = 0.1; seconds < 20.0; seconds *= 10.0) {
        const double now = held(line, seconds);
        CHECK(now > 1.01 * last);
        last = now;
    }
}

static void a_set_shifts_rest_and_response_and_goes_over_minutes(void)
{
    const double c = layer_compression(1.0 / 25e-6), depth = 0.2 * (c - 5e-5);
    bench_open(&bench, "indent set fraction=0.2 threshold_m=5e-5 recovery_s=100", -1);
    bench_press(&bench, MIDDLE, 1.0, 0.01, false);
    bench_press(&bench, MIDDLE, 0.0, 0.0, true);
    const double rest = bench.fields[MIDDLE].rise;
    CHECK(fabs(rest / layer_compression_rise(depth) - 1.0) < 1e-6);
    CHECK(bench.fields[MIDDLE + 1].rise == 0.0);
    bench_press(&bench, MIDDLE, 0.1, 0.0, true);
    const double response = layer_compression_rise(depth + layer_compression(0.1 / 25e-6) * (1.0 - depth / 0.0008));
    CHECK(fabs(bench.fields[MIDDLE].rise / response - 1.0) < 1e-6);
    bench_press(&bench, MIDDLE, 0.0, 100.0, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_compression_rise(depth * exp(-1.0)) - 1.0) < 1e-6);
    bench_press(&bench, MIDDLE, 0.0, 2000.0, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0 && !field_is_awake(&bench.field, bench.time));
    bench_close(&bench);
}

static void a_press_below_the_threshold_leaves_no_set(void)
{
    bench_open(&bench, "indent set fraction=0.2 threshold_m=2e-4 recovery_s=100", -1);
    bench_press(&bench, MIDDLE, 0.1, 0.01, false);
    bench_press(&bench, MIDDLE, 0.0, 0.01, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0 && !field_is_awake(&bench.field, bench.time));
    bench_close(&bench);
}

static void bedding_takes_sensitivity_with_the_work_and_keeps_it(void)
{
    const double full = layer_pressure_rise(FORCE_N / 25e-6), c = layer_compression(FORCE_N / 25e-6);
    double last = full;
    bench_open(&bench, "indent bedding fraction=0.3 work_j_m2=10", -1);
    for (int n = 1; n <= 30; n++) {
        bench_press(&bench, MIDDLE, FORCE_N, 0.1, false);
        const double part = 1.0 - 0.3 * (1.0 - exp(-n * layer_work(c) / 10.0));
        CHECK(fabs(bench.fields[MIDDLE].rise / layer_compression_rise(part * c) - 1.0) < 1e-4);
        CHECK(bench.fields[MIDDLE].rise < last);
        last = bench.fields[MIDDLE].rise;
        bench_press(&bench, MIDDLE, 0.0, 1000.0, false);
        CHECK(bench.fields[MIDDLE].rise == 0.0);
    }
    CHECK(last > layer_compression_rise(0.7 * c) * 0.999);
    bench_close(&bench);
}

/* Rise of the middle taxel with an object's face over all cells, or tilted. */
static double over_gap(double gap, double tilt)
{
    field_load_clear(&bench.after, &bench.patch);
    for (size_t i = 0; i < BENCH_CELLS; i++) {
        bench.after.gap[i] = gap + tilt * (double)(i % CELLS_PER_SIDE);
    }
    memset(bench.compression, 0, sizeof bench.compression);
    field_press(&bench.field, false, bench.compression, &bench.after);
    bench_go(&bench, 0.01, true);
    return bench.fields[MIDDLE].rise;
}

static void an_object_is_felt_before_it_touches(void)
{
    static const struct {
        const char *line;
        double far;
    } forms[] = {{"proximity image share=0.2 reach_m=0.004", 0.02}, {"proximity wedge share=0.2 reach_m=0.001", 0.001}};
    for (size_t i = 0; i < 2; i++) {
        bench_open(&bench, forms[i].line, -1);
        CHECK(fabs(over_gap(0.0, 0.0) - 0.2) < 1e-12);
        CHECK(fabs(over_gap(1e-7, 0.0) - 0.2) < 1e-4);
        double last = 0.2;
        for (double gap = 1e-5; gap < forms[i].far; gap *= 1.1) {
            const double rise = over_gap(gap, 0.0);
            CHECK(rise < last && rise > 0.0);
            last = rise;
        }
        CHECK(over_gap(forms[i].far * 0.9999, 0.0) < 2e-5);
        CHECK(over_gap(forms[i].far, 0.0) == 0.0);
        CHECK(over_gap(0.0, 2e-4) > over_gap(3e-4, 0.0)); /* the same mean gap: the near cells count for more */
        memset(bench.compression, 0, sizeof bench.compression);
        bench.compression[MIDDLE * CELLS_PER_TAXEL] = 1e-9;
        for (size_t n = 0; n < BENCH_CELLS; n++) {
            bench.after.gap[n] = 0.0;
        }
        field_press(&bench.field, true, bench.compression, &bench.after);
        bench_go(&bench, 0.01, false);
        CHECK(fabs(bench.fields[MIDDLE].rise - 0.2) < 1e-6); /* no leap as it touches */
        bench_close(&bench);
    }
}

static void images_fade_by_the_gap_over_the_electrodes_distance(void)
{
    const double t = 0.001, least = log1p(0.002 * 0.002 / (0.021 * 0.021)), most = log1p(4.0);
    bench_open(&bench, "proximity image share=0.2 reach_m=0.004", -1);
    for (double gap = 1e-4; gap < 0.02; gap += 7e-4) {
        const double ratio = 0.002 / (t + gap);
        CHECK(fabs(over_gap(gap, 0.0) - 0.2 * (log1p(ratio * ratio) - least) / (most - least)) < 2e-5);
    }
    bench_close(&bench);
}

static void moisture_raises_rest_and_lowers_the_response(void)
{
    bench_open(&bench, "moisture film board=0x22 tx=3 rx=3 radius_m=0.006 water=0.05", -1);
    bench_press(&bench, MIDDLE, 0.0, 0.01, false);
    const double rest = bench.fields[MIDDLE].rise;
    CHECK(fabs(rest / expm1(0.05 * log(80.0) * 0.65) - 1.0) < 1e-3);
    CHECK(bench.fields[0].rise < 1e-5);
    CHECK(bench.fields[MIDDLE + 1].rise < rest && bench.fields[MIDDLE + 1].rise > bench.fields[MIDDLE + 2].rise);
    bench_press(&bench, MIDDLE, FORCE_N, 0.01, false);
    const double answer = bench.fields[MIDDLE].rise - rest;
    CHECK(answer > 0.0 && answer < layer_pressure_rise(FORCE_N / 25e-6));
    CHECK(!field_is_awake(&bench.field, bench.time));
    bench_close(&bench);
}

static void a_moist_patch_dries(void)
{
    bench_open(&bench, "moisture drying board=0x22 tx=3 rx=3 radius_m=0.006 water=0.05 seconds=60", -1);
    bench_press(&bench, MIDDLE, 0.0, 60.0, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / expm1(0.05 * exp(-1.0) * log(80.0) * 0.65) - 1.0) < 1e-3);
    CHECK(field_is_awake(&bench.field, bench.time));
    bench_press(&bench, MIDDLE, 0.0, 6000.0, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0 && !field_is_awake(&bench.field, bench.time));
    bench_close(&bench);
}

static void stiffer_pillars_answer_as_to_a_smaller_force(void)
{
    bench_open(&bench, "modulus board board=0x22 factor=2", -1);
    bench_press(&bench, MIDDLE, FORCE_N, 0.01, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_pressure_rise(0.5 * FORCE_N / 25e-6) - 1.0) < 1e-9);
    CHECK(fabs(bench.fields[MIDDLE].force - FORCE_N) < 1e-9); /* the force is what it was */
    bench_close(&bench);
    bench_open(&bench, "modulus board board=0x22 factor=1 gradient=0.8", -1);
    CHECK(fabs(bench.field.stiffness[63] / bench.field.stiffness[0] - exp(0.7)) < 1e-9); /* 7 of 8 lines apart */
    bench_close(&bench);
}

static void taxels_differ_log_normally(void)
{
    double sum = 0.0, squares = 0.0;
    bench_open(&bench, "modulus taxels log_std=0.2", -1);
    for (size_t i = 0; i < BENCH_TAXELS; i++) {
        sum += log(bench.field.stiffness[i]);
        squares += log(bench.field.stiffness[i]) * log(bench.field.stiffness[i]);
    }
    const double mean = sum / BENCH_TAXELS;
    CHECK_BETWEEN(mean, -0.08, 0.08);
    CHECK_BETWEEN(sqrt(squares / BENCH_TAXELS - mean * mean), 0.15, 0.25);
    bench_close(&bench);
}

int main(void)
{
    RUN(a_film_keeps_the_force);
    RUN(a_films_kernel_falls_to_1_over_e_at_its_length);
    RUN(nothing_gets_past_a_hole);
    RUN(pillars_grow_the_patch_the_more_the_gentler_they_slope);
    RUN(forces_spread_by_pillars_too);
    RUN(a_solid_creeps_to_the_layers_own_curve_and_recovers);
    RUN(rheology_does_not_depend_on_the_records_spacing);
    RUN(sticking_pillars_make_a_loop_that_ignores_the_rate);
    RUN(plays_creep_goes_on_over_decades);
    RUN(a_set_shifts_rest_and_response_and_goes_over_minutes);
    RUN(a_press_below_the_threshold_leaves_no_set);
    RUN(bedding_takes_sensitivity_with_the_work_and_keeps_it);
    RUN(an_object_is_felt_before_it_touches);
    RUN(images_fade_by_the_gap_over_the_electrodes_distance);
    RUN(moisture_raises_rest_and_lowers_the_response);
    RUN(a_moist_patch_dries);
    RUN(stiffer_pillars_answer_as_to_a_smaller_force);
    RUN(taxels_differ_log_normally);
    return check_summary();
}
