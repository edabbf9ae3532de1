/* Physical properties of each effect of the skin. */
#include <math.h>
#include <stdio.h>

#include "emulator/effects/proximity_target.h"
#include "skin_bench.h"

#define MIDDLE 27u /* TX 3, RX 3 */
#define FORCE_N 0.5

static struct skin_bench bench;

/* Sum of the forces (newtons) on all taxels. */
static double total_force(void)
{
    double sum = 0.0;
    for (size_t i = 0; i < bench.patch.taxel_count; i++) {
        sum += bench.fields[i].force;
    }
    return sum;
}

static void a_film_preserves_the_total_force(void)
{
    static const double taxels[] = {0, 7, 27, 63};
    for (size_t i = 0; i < 4; i++) {
        bench_open(&bench, "spread film length_m=0.003", -1);
        bench_apply_force(&bench, (size_t)taxels[i], FORCE_N, 0.01, false);
        CHECK(fabs(total_force() / FORCE_N - 1.0) < 1e-9);
        CHECK(bench.fields[(size_t)taxels[i]].force < FORCE_N);
        bench_close(&bench);
    }
}

static void the_kernel_of_a_film_falls_to_1_over_e_at_its_length(void)
{
    bench_open(&bench, "spread film length_m=0.00375", -1); /* 3 cells */
    double pressure[BENCH_CELLS] = {0.0};
    const int columns = bench.patch.grid_columns, source = 12 * columns + 12;
    pressure[bench.patch.cell_at[source]] = 1000.0;
    spread_pressure(&bench.field.spread, &bench.world.effects.spread, &bench.patch, pressure);
    for (int distance = 0; distance < 9; distance++) {
        const double pressure_near = pressure[bench.patch.cell_at[source + distance]];
        const double pressure_beyond = pressure[bench.patch.cell_at[source + distance + 3]];
        CHECK(fabs(pressure_beyond / pressure_near - exp(-1.0)) < 1e-12);
        CHECK(fabs(pressure[bench.patch.cell_at[source + columns * (distance + 3)]] / pressure_beyond - 1.0) < 1e-12);
    }
    bench_close(&bench);
}

static void pressure_does_not_spread_across_a_hole(void)
{
    const int columns = BENCH_LINES * CELLS_PER_SIDE;
    bench_open(&bench, "spread film length_m=0.00375", (int)MIDDLE);
    double pressure[BENCH_CELLS] = {0.0};
    pressure[bench.patch.cell_at[12 * columns + 11]] = 1000.0; /* beside the hole */
    spread_pressure(&bench.field.spread, &bench.world.effects.spread, &bench.patch, pressure);
    double beyond = 0.0, around = 0.0;
    for (int column = 16; column < columns; column++) {
        beyond += pressure[bench.patch.cell_at[12 * columns + column]];
        around += pressure[bench.patch.cell_at[11 * columns + column]];
    }
    /* pressure spreads along its row first, then along the columns that it reached */
    CHECK(beyond == 0.0 && around == 0.0);
    CHECK(pressure[bench.patch.cell_at[16 * columns + 11]] > 0.0);
    bench_close(&bench);
}

/* Return the number of compressed cells when one cell is compressed by 0.4 mm, with the effect `spread pillars` of this
 * slope. Also checks the compression of the cell and of its neighbour. */
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

static void a_smaller_slope_gives_a_larger_contact_patch(void)
{
    const double steep = pressed_cells(1.0), mid = pressed_cells(0.2), gentle = pressed_cells(0.05);
    CHECK(steep == 1.0);
    CHECK(mid > steep && gentle > mid);
}

/* Initialise the sheet of three taxels with sides of 4 mm in one row, whose centres are 5 mm and then 20 mm apart, and
 * its state of an effect. */
static void make_uneven_sheet(struct patch *patch, struct spread_state *state, const struct spread_effect *spread)
{
    static const uint8_t map[TAXEL_CROSSING_MAP_SIZE] = {0x7};
    static const double across[] = {0.0, 0.005, 0.025};
    struct taxel_pose poses[3];
    for (int i = 0; i < 3; i++) {
        poses[i] = (struct taxel_pose){
            .position = {0.0, -across[i], 0.0},
            .normal = {0.0, 0.0, 1.0},
            .distal = {1.0, 0.0, 0.0},
            .size = {0.004, 0.004},
            .has_place = true,
            .column = i,
        };
    }
    CHECK_EQUAL(patch_init(patch, 1, 3, map, 3, poses), 0);
    CHECK_EQUAL(spread_init(state, spread, patch), 0);
}

static void contact_spreads_by_the_distances_between_cells(void)
{
    /* the last column of cells of the second taxel, and the first columns of both neighbours */
    const int last = CELLS_PER_TAXEL + CELLS_PER_SIDE - 1, next = 2 * CELLS_PER_TAXEL;
    struct patch patch;
    struct spread_state state;
    const struct spread_effect pillars = {.form = SPREAD_PILLARS, .slope = 0.05, .strength = 1.0};
    double compression[3 * CELLS_PER_TAXEL] = {0.0}, pressure[3 * CELLS_PER_TAXEL] = {0.0};
    make_uneven_sheet(&patch, &state, &pillars);
    compression[last] = 0.0004;
    spread_compression(&state, &pillars, &patch, compression);
    CHECK(fabs(compression[last - 1] - (0.0004 - 0.05 * 0.001)) < 1e-12);
    CHECK(fabs(compression[CELLS_PER_SIDE - 1] - (0.0004 - 0.05 * 0.005)) < 1e-12);
    CHECK(compression[next] == 0.0); /* 17 mm away; the compression falls to 0 within 8 mm */
    spread_free(&state);
    patch_free(&patch);

    const struct spread_effect film = {.form = SPREAD_FILM, .length_m = 0.004, .strength = 1.0};
    make_uneven_sheet(&patch, &state, &film);
    pressure[last] = 1000.0;
    spread_pressure(&state, &film, &patch, pressure);
    CHECK(fabs(pressure[next] / pressure[last] - exp(-17.0 / 4.0)) < 1e-9);
    CHECK(fabs(pressure[last - 1] / pressure[last] - exp(-1.0 / 4.0)) < 1e-9);
    spread_free(&state);
    patch_free(&patch);
}

static void forces_of_a_stimulus_spread_by_pillars(void)
{
    bench_open(&bench, "spread pillars slope=0.05", -1);
    bench_apply_force(&bench, MIDDLE, FORCE_N, 0.01, false);
    CHECK(bench.fields[MIDDLE].rise > bench.fields[MIDDLE + 1].rise && bench.fields[MIDDLE + 1].rise > 0.0);
    CHECK(bench.fields[0].rise == 0.0);
    bench_close(&bench);
}

/* Return the relative rise of the loaded taxel's capacitance after a constant force for `seconds`. */
static double rise_after_hold(const char *line, double seconds)
{
    bench_open(&bench, line, -1);
    bench_apply_force(&bench, MIDDLE, FORCE_N, 0.0, true);
    if (seconds > 0.0) {
        bench_apply_force(&bench, MIDDLE, FORCE_N, seconds, false);
    }
    const double rise = bench.fields[MIDDLE].rise;
    bench_close(&bench);
    return rise;
}

static void a_solid_creeps_to_the_elastic_curve_and_recovers(void)
{
    const char *line = "rheology solid fraction=0.3 seconds=2";
    const double full = layer_rise_at_pressure(FORCE_N / 25e-6), c = layer_compression(FORCE_N / 25e-6);
    CHECK(fabs(rise_after_hold(line, 0.0) / layer_rise_at_compression(0.7 * c) - 1.0) < 1e-4);
    CHECK(fabs(rise_after_hold(line, 2.0) / layer_rise_at_compression((1.0 - 0.3 * exp(-1.0)) * c) - 1.0) < 1e-4);
    CHECK(fabs(rise_after_hold(line, 100.0) / full - 1.0) < 1e-4);
    bench_open(&bench, line, -1);
    bench_apply_force(&bench, MIDDLE, FORCE_N, 0.0, true);
    bench_apply_force(&bench, MIDDLE, FORCE_N, 100.0, false);
    bench_apply_force(&bench, MIDDLE, 0.0, 0.0, true);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_rise_at_compression(0.3 * c) - 1.0) < 1e-9);
    bench_apply_force(&bench, MIDDLE, 0.0, 2.0, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_rise_at_compression(0.3 * exp(-1.0) * c) - 1.0) < 1e-9);
    CHECK(field_has_history(&bench.field, bench.time));
    bench_apply_force(&bench, MIDDLE, 0.0, 100.0, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0);
    CHECK(!field_has_history(&bench.field, bench.time));
    bench_close(&bench);
}

/* One long step and many short steps give equal results up to rounding. */
static void rheology_is_independent_of_the_record_interval(void)
{
    static const char *const lines[] = {"rheology solid fraction=0.3 seconds=0.7",
                                        "rheology play fraction=0.4 width_m=1e-4 creep=0.2 seconds=0.7"};
    for (size_t i = 0; i < 2; i++) {
        double rise[2];
        for (int fine = 0; fine < 2; fine++) {
            const int steps = fine ? 500 : 1;
            bench_open(&bench, lines[i], -1);
            bench_apply_force(&bench, MIDDLE, FORCE_N, 0.0, true);
            for (int n = 0; n < steps; n++) {
                bench_apply_force(&bench, MIDDLE, FORCE_N, 3.0 / steps, false);
            }
            rise[fine] = bench.fields[MIDDLE].rise;
            bench_close(&bench);
        }
        CHECK(fabs(rise[1] / rise[0] - 1.0) < 1e-9);
    }
}

static void sticking_pillars_have_rate_independent_hysteresis(void)
{
    static const double rates[] = {0.01, 10.0};
    double up[2], down[2];
    for (int i = 0; i < 2; i++) {
        bench_open(&bench, "rheology play fraction=0.5 width_m=1e-4 seconds=1", -1);
        bench_apply_force(&bench, MIDDLE, 0.4, rates[i], false);
        up[i] = bench.fields[MIDDLE].rise;
        bench_apply_force(&bench, MIDDLE, 1.0, rates[i], false);
        bench_apply_force(&bench, MIDDLE, 0.4, rates[i], false);
        down[i] = bench.fields[MIDDLE].rise;
        bench_apply_force(&bench, MIDDLE, 0.0, rates[i], false);
        CHECK(bench.fields[MIDDLE].rise == 0.0); /* no lag without load */
        bench_close(&bench);
    }
    CHECK(up[0] == up[1] && down[0] == down[1]);
    CHECK(down[0] > 1.02 * up[0]);
    CHECK(down[0] <= layer_rise_at_pressure(0.4 / 25e-6) * (1.0 + 1e-4));
}

static void creep_of_sticking_pillars_continues_over_decades(void)
{
    const char *line = "rheology play fraction=0 width_m=1e-4 creep=0.3 seconds=1";
    double last = rise_after_hold(line, 0.0);
    for (double seconds = 0.1; seconds < 20.0; seconds *= 10.0) {
        const double now = rise_after_hold(line, seconds);
        CHECK(now > 1.01 * last);
        last = now;
    }
}

static void compression_set_shifts_rest_and_response_and_recovers(void)
{
    const double c = layer_compression(1.0 / 25e-6), depth = 0.2 * (c - 5e-5);
    bench_open(&bench, "indent set fraction=0.2 threshold_m=5e-5 recovery_s=100", -1);
    bench_apply_force(&bench, MIDDLE, 1.0, 0.01, false);
    bench_apply_force(&bench, MIDDLE, 0.0, 0.0, true);
    const double rest_rise = bench.fields[MIDDLE].rise;
    CHECK(fabs(rest_rise / layer_rise_at_compression(depth) - 1.0) < 1e-6);
    CHECK(bench.fields[MIDDLE + 1].rise == 0.0);
    bench_apply_force(&bench, MIDDLE, 0.1, 0.0, true);
    const double response = layer_rise_at_compression(depth + layer_compression(0.1 / 25e-6) * (1.0 - depth / 0.0008));
    CHECK(fabs(bench.fields[MIDDLE].rise / response - 1.0) < 1e-6);
    bench_apply_force(&bench, MIDDLE, 0.0, 100.0, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_rise_at_compression(depth * exp(-1.0)) - 1.0) < 1e-6);
    bench_apply_force(&bench, MIDDLE, 0.0, 2000.0, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0 && !field_has_history(&bench.field, bench.time));
    bench_close(&bench);
}

static void contact_below_the_threshold_leaves_no_set(void)
{
    bench_open(&bench, "indent set fraction=0.2 threshold_m=2e-4 recovery_s=100", -1);
    bench_apply_force(&bench, MIDDLE, 0.1, 0.01, false);
    bench_apply_force(&bench, MIDDLE, 0.0, 0.01, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0 && !field_has_history(&bench.field, bench.time));
    bench_close(&bench);
}

static void bedding_reduces_sensitivity_permanently_with_the_work(void)
{
    const double full = layer_rise_at_pressure(FORCE_N / 25e-6), c = layer_compression(FORCE_N / 25e-6);
    double last = full;
    bench_open(&bench, "indent bedding fraction=0.3 work_j_m2=10", -1);
    for (int n = 1; n <= 30; n++) {
        bench_apply_force(&bench, MIDDLE, FORCE_N, 0.1, false);
        const double part = 1.0 - 0.3 * (1.0 - exp(-n * layer_work(c) / 10.0));
        CHECK(fabs(bench.fields[MIDDLE].rise / layer_rise_at_compression(part * c) - 1.0) < 1e-4);
        CHECK(bench.fields[MIDDLE].rise < last);
        last = bench.fields[MIDDLE].rise;
        bench_apply_force(&bench, MIDDLE, 0.0, 1000.0, false);
        CHECK(bench.fields[MIDDLE].rise == 0.0);
    }
    CHECK(last > layer_rise_at_compression(0.7 * c) * 0.999);
    bench_close(&bench);
}

/* Return the relative rise of the middle taxel's capacitance under an object at a gap over all cells. tilt: additional
 * gap from column to column of a taxel's cells, metres. */
static double rise_at_gap(double gap, double tilt)
{
    field_load_clear(&bench.after, &bench.patch);
    for (size_t i = 0; i < BENCH_CELLS; i++) {
        bench.after.gap[i] = gap + tilt * (double)(i % CELLS_PER_SIDE);
    }
    memset(bench.compression, 0, sizeof bench.compression);
    field_load_contact(&bench.field, false, bench.compression, &bench.after);
    bench_advance(&bench, 0.01, true);
    return bench.fields[MIDDLE].rise;
}

static void proximity_raises_the_capacitance_before_contact(void)
{
    static const struct {
        const char *line;
        double reach;
    } forms[] = {{"proximity image share=0.2 reach_m=0.004", 0.02}, {"proximity wedge share=0.2 reach_m=0.001", 0.001}};
    for (size_t i = 0; i < 2; i++) {
        bench_open(&bench, forms[i].line, -1);
        CHECK(fabs(rise_at_gap(0.0, 0.0) - 0.2) < 1e-12);
        CHECK(fabs(rise_at_gap(1e-7, 0.0) - 0.2) < 1e-4);
        double last = 0.2;
        for (double gap = 1e-5; gap < forms[i].reach; gap *= 1.1) {
            const double rise = rise_at_gap(gap, 0.0);
            CHECK(rise < last && rise > 0.0);
            last = rise;
        }
        CHECK(rise_at_gap(forms[i].reach * 0.9999, 0.0) < 2e-5);
        CHECK(rise_at_gap(forms[i].reach, 0.0) == 0.0);
        CHECK(rise_at_gap(0.0, 2e-4) > rise_at_gap(3e-4, 0.0)); /* equal mean gap: the nearer cells contribute more */
        memset(bench.compression, 0, sizeof bench.compression);
        bench.compression[MIDDLE * CELLS_PER_TAXEL] = 1e-9;
        for (size_t n = 0; n < BENCH_CELLS; n++) {
            bench.after.gap[n] = 0.0;
        }
        field_load_contact(&bench.field, true, bench.compression, &bench.after);
        bench_advance(&bench, 0.01, false);
        CHECK(fabs(bench.fields[MIDDLE].rise - 0.2) < 1e-6); /* continuous at first contact */
        bench_close(&bench);
    }
}

static void the_image_response_follows_its_formula(void)
{
    const double t = 0.001, far_response = log1p(0.002 * 0.002 / (0.021 * 0.021)), contact_response = log1p(4.0);
    bench_open(&bench, "proximity image share=0.2 reach_m=0.004", -1);
    for (double gap = 1e-4; gap < 0.02; gap += 7e-4) {
        const double ratio = 0.002 / (t + gap);
        CHECK(fabs(rise_at_gap(gap, 0.0) -
                   0.2 * (log1p(ratio * ratio) - far_response) / (contact_response - far_response)) < 2e-5);
    }
    bench_close(&bench);
}

/* Return the relative rise of the middle taxel at a gap under an effect line, with an object parallel to the skin. */
static double rise_of_target(const char *line, double gap)
{
    bench_open(&bench, line, -1);
    const double rise = rise_at_gap(gap, 0.0);
    bench_close(&bench);
    return rise;
}

static void a_conductor_at_ground_lowers_the_capacitance_before_contact(void)
{
    static const char line[] = "proximity conductor share=0.2 reach_m=0.004";
    CHECK(fabs(rise_of_target(line, 0.0) + 0.2) < 1e-9);
    double last = -0.2;
    for (double gap = 1e-5; gap < 0.02; gap *= 1.3) {
        const double rise = rise_of_target(line, gap);
        CHECK(rise > last && rise < 0.0);
        last = rise;
    }
    CHECK(rise_of_target(line, 0.02) == 0.0);
}

static void an_isolated_conductor_raises_the_capacitance(void)
{
    double last = 1.0;
    for (double grounding = 0.0; grounding <= 1.0; grounding += 0.25) {
        char line[80];
        (void)snprintf(line, sizeof line, "proximity conductor share=0.2 reach_m=0.004 grounding=%g", grounding);
        const double rise = rise_of_target(line, 0.001);
        CHECK(rise < last);
        last = rise;
    }
    CHECK(rise_of_target("proximity conductor share=0.2 reach_m=0.004 grounding=0", 0.001) > 0.2);
}

static void a_dielectric_raises_the_capacitance_near_the_skin_and_responds_less_than_a_conductor(void)
{
    static const char thin[] = "proximity dielectric share=0.2 reach_m=0.004 permittivity=3 thickness_m=0.001";
    CHECK(rise_of_target(thin, 0.0) > 0.0);
    CHECK(fabs(rise_of_target(thin, 0.002)) <
          0.1 * -rise_of_target("proximity conductor share=0.2 reach_m=0.004", 0.002));
    /* A thick body of water reflects nearly as a conductor at ground does. */
    const double water = rise_of_target("proximity dielectric share=0.2 reach_m=0.004 permittivity=80", 0.002);
    const double ground = rise_of_target("proximity conductor share=0.2 reach_m=0.004", 0.002);
    CHECK(water < 0.75 * ground && water > ground);
}

/* Reference: potentials of two line electrodes between two planes at ground, as a sum of image charges. */
static void the_response_to_a_conductor_agrees_with_image_charges(void)
{
    const double distance = 0.004, depth = 0.002, radius = 0.0005;
    const struct proximity_target target = {.is_conductor = true, .distance = distance, .grounding = 1.0};
    for (double z = 0.001; z < 0.02; z *= 1.7) {
        const double offset[2] = {0.0, distance};
        double potential[2] = {0.0, 0.0};
        for (int n = -20000; n <= 20000; n++) {
            const double same = 2.0 * n * (depth + z), opposite = same - 2.0 * depth;
            for (int i = 0; i < 2; i++) {
                potential[i] += log(hypot(offset[i], opposite)) - log(n || i ? hypot(offset[i], same) : radius);
            }
        }
        const double rest[2] = {log(2.0 * depth / radius), 0.5 * log1p(1.0)};
        const double near_f = potential[1] / (potential[0] * potential[0] - potential[1] * potential[1]);
        const double rest_f = rest[1] / (rest[0] * rest[0] - rest[1] * rest[1]);
        CHECK(fabs(proximity_target_change(&target, z) - (near_f / rest_f - 1.0)) < 1e-3);
    }
}

static void moisture_raises_rest_and_lowers_the_response(void)
{
    bench_open(&bench, "moisture film board=0x22 tx=3 rx=3 radius_m=0.006 water=0.05", -1);
    bench_apply_force(&bench, MIDDLE, 0.0, 0.01, false);
    const double rest_rise = bench.fields[MIDDLE].rise;
    CHECK(fabs(rest_rise / expm1(0.05 * log(80.0) * 0.65) - 1.0) < 1e-3);
    CHECK(bench.fields[0].rise < 1e-5);
    CHECK(bench.fields[MIDDLE + 1].rise < rest_rise && bench.fields[MIDDLE + 1].rise > bench.fields[MIDDLE + 2].rise);
    bench_apply_force(&bench, MIDDLE, FORCE_N, 0.01, false);
    const double response = bench.fields[MIDDLE].rise - rest_rise;
    CHECK(response > 0.0 && response < layer_rise_at_pressure(FORCE_N / 25e-6));
    CHECK(!field_has_history(&bench.field, bench.time));
    bench_close(&bench);
}

static void a_moist_patch_dries(void)
{
    bench_open(&bench, "moisture drying board=0x22 tx=3 rx=3 radius_m=0.006 water=0.05 seconds=60", -1);
    bench_apply_force(&bench, MIDDLE, 0.0, 60.0, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / expm1(0.05 * exp(-1.0) * log(80.0) * 0.65) - 1.0) < 1e-3);
    CHECK(field_has_history(&bench.field, bench.time));
    bench_apply_force(&bench, MIDDLE, 0.0, 6000.0, false);
    CHECK(bench.fields[MIDDLE].rise == 0.0 && !field_has_history(&bench.field, bench.time));
    bench_close(&bench);
}

static void pillars_of_twice_the_modulus_respond_as_to_half_the_force(void)
{
    bench_open(&bench, "modulus board board=0x22 factor=2", -1);
    bench_apply_force(&bench, MIDDLE, FORCE_N, 0.01, false);
    CHECK(fabs(bench.fields[MIDDLE].rise / layer_rise_at_pressure(0.5 * FORCE_N / 25e-6) - 1.0) < 1e-9);
    CHECK(fabs(bench.fields[MIDDLE].force - FORCE_N) < 1e-9); /* the force is unchanged */
    bench_close(&bench);
    bench_open(&bench, "modulus board board=0x22 factor=1 gradient=0.8", -1);
    CHECK(fabs(bench.field.stiffness[63] / bench.field.stiffness[0] - exp(0.7)) < 1e-9); /* 7 of 8 lines apart */
    bench_close(&bench);
}

static void the_stiffness_of_taxels_is_log_normal(void)
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
    RUN(a_film_preserves_the_total_force);
    RUN(the_kernel_of_a_film_falls_to_1_over_e_at_its_length);
    RUN(pressure_does_not_spread_across_a_hole);
    RUN(a_smaller_slope_gives_a_larger_contact_patch);
    RUN(contact_spreads_by_the_distances_between_cells);
    RUN(forces_of_a_stimulus_spread_by_pillars);
    RUN(a_solid_creeps_to_the_elastic_curve_and_recovers);
    RUN(rheology_is_independent_of_the_record_interval);
    RUN(sticking_pillars_have_rate_independent_hysteresis);
    RUN(creep_of_sticking_pillars_continues_over_decades);
    RUN(compression_set_shifts_rest_and_response_and_recovers);
    RUN(contact_below_the_threshold_leaves_no_set);
    RUN(bedding_reduces_sensitivity_permanently_with_the_work);
    RUN(proximity_raises_the_capacitance_before_contact);
    RUN(the_image_response_follows_its_formula);
    RUN(a_conductor_at_ground_lowers_the_capacitance_before_contact);
    RUN(an_isolated_conductor_raises_the_capacitance);
    RUN(a_dielectric_raises_the_capacitance_near_the_skin_and_responds_less_than_a_conductor);
    RUN(the_response_to_a_conductor_agrees_with_image_charges);
    RUN(moisture_raises_rest_and_lowers_the_response);
    RUN(a_moist_patch_dries);
    RUN(pillars_of_twice_the_modulus_respond_as_to_half_the_force);
    RUN(the_stiffness_of_taxels_is_log_normal);
    return check_summary();
}
