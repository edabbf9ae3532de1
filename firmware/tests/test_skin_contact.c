/* Contact of a flat board with a flat object, and the layer's curves that it rests on. */
#include <math.h>

#include "check.h"
#include "emulator/layer.h"
#include "emulator/skin/contact.h"

#define TAXELS 12u
#define THICKNESS_M 0.001
#define DEPTH_M 0.0002
#define CELLS (TAXELS * CELLS_PER_TAXEL)
#define MOTION 1e-7 /* metres and radians of a finite difference */

static const uint8_t map[TAXEL_CROSSING_MAP_SIZE] = {0xFF, 0x0F};
static const struct shape table = {
    .kind = SHAPE_CONVEX,
    .bound = 0.3,
    .plane_count = 6,
    .planes = {{0, 0, 1, 0}, {0, 0, -1, 0.1}, {1, 0, 0, 0.2}, {-1, 0, 0, 0.2}, {0, 1, 0, 0.2}, {0, -1, 0, 0.2}},
};
static struct patch patch;
static double compression[CELLS], gap[CELLS];

/* The board face down over the table, its skin so far above it (negative: pressed in). */
static struct frame over_table(double height)
{
    const double translation[3] = {0.0, 0.0, THICKNESS_M + height}, over[3] = {3.141592653589793, 0.0, 0.0};
    return frame_of_offset(translation, over);
}

static void force_is_pressure_times_area_and_pushes_the_board_away(void)
{
    const struct frame frame = over_table(-DEPTH_M);
    struct contact_load load;
    CHECK(contact_press(&patch, &table, &frame, THICKNESS_M, CONTACT_FAR_M, compression, gap, &load));
    for (size_t i = 0; i < CELLS; i++) {
        CHECK(fabs(compression[i] - DEPTH_M) < 1e-15);
        CHECK(gap[i] == 0.0);
    }
    const double force = layer_contact_pressure(DEPTH_M) * TAXELS * TAXEL_PITCH_M * TAXEL_PITCH_M;
    CHECK(fabs(load.wrench[2] / -force - 1.0) < 1e-9); /* the board's normal, z, looks at the table */
    CHECK(fabs(load.wrench[0]) < 1e-12 && fabs(load.wrench[1]) < 1e-12);
}

static void the_stiffness_is_the_derivative_of_the_wrench(void)
{
    const struct frame frame = over_table(-DEPTH_M);
    struct contact_load load, side[2];
    CHECK(contact_press(&patch, &table, &frame, THICKNESS_M, 0.0, compression, NULL, &load));
    for (int motion = 0; motion < 6; motion++) {
        double scale = 0.0;
        for (int s = 0; s < 2; s++) {
            double step[6] = {0.0};
            step[motion] = s ? MOTION : -MOTION;
            const struct frame moved = frame_of_offset(step, step + 3), there = frame_product(&frame, &moved);
            CHECK(contact_press(&patch, &table, &there, THICKNESS_M, 0.0, compression, NULL, &side[s]));
        }
        for (int i = 0; i < 6; i++) {
            scale = fmax(scale, fabs(load.stiffness[i][motion]));
        }
        for (int i = 0; i < 6; i++) {
            const double slope = (side[1].wrench[i] - side[0].wrench[i]) / (2.0 * MOTION);
            CHECK(fabs(slope + load.stiffness[i][motion]) <= 1e-5 * scale + 1e-6);
        }
    }
}

static void before_contact_there_are_gaps_and_no_force(void)
{
    const struct frame frame = over_table(0.003);
    struct contact_load load;
    CHECK(!contact_press(&patch, &table, &frame, THICKNESS_M, 0.01, compression, gap, &load));
    for (size_t i = 0; i < CELLS; i++) {
        CHECK(compression[i] == 0.0 && fabs(gap[i] - 0.003) < 1e-12);
    }
    CHECK(load.wrench[2] == 0.0 && load.stiffness[2][2] == 0.0);
    CHECK(!contact_press(&patch, &table, &frame, THICKNESS_M, 0.002, compression, gap, NULL));
    CHECK(gap[0] == CONTACT_FAR_M); /* nobody asked that far */
}

static void an_object_that_is_far_does_nothing(void)
{
    struct frame frame = over_table(0.5);
    struct contact_load load;
    CHECK(contact_is_far(&patch, &table, &frame, CONTACT_FAR_M));
    CHECK(!contact_press(&patch, &table, &frame, THICKNESS_M, CONTACT_FAR_M, compression, gap, &load));
    for (size_t i = 0; i < CELLS; i++) {
        CHECK(compression[i] == 0.0 && gap[i] == CONTACT_FAR_M);
    }
    CHECK(load.wrench[2] == 0.0);
    frame = over_table(-DEPTH_M);
    CHECK(!contact_is_far(&patch, &table, &frame, 0.0));
}

static void pressure_stiffness_and_work_are_derivatives_of_each_other(void)
{
    for (double c = 1e-5; c < 0.0006; c += 3.1e-6) {
        const double step = 1e-9;
        const double slope = (layer_pressure(c + step) - layer_pressure(c - step)) / (2.0 * step);
        const double gain = (layer_work(c + step) - layer_work(c - step)) / (2.0 * step);
        CHECK(fabs(slope / layer_stiffness(c) - 1.0) < 2e-4 || c > 0.00051); /* one kink, where the line takes over */
        CHECK(fabs(gain / layer_pressure(c) - 1.0) < 1e-5);
    }
    CHECK(layer_pressure(-1e-6) == 0.0 && layer_stiffness(0.0) == 0.0 && layer_work(0.0) == 0.0);
}

/* Pillars and the sheet under them carry the same pressure. */
static void the_whole_layer_gives_way_more_than_its_pillars(void)
{
    double last = 0.0;
    for (double c = 1e-6; c < 0.0006; c *= 1.02) {
        const double pressure = layer_contact_pressure(c), step = 1e-5 * c;
        const double slope = (layer_contact_pressure(c + step) - layer_contact_pressure(c - step)) / (2.0 * step);
        CHECK(pressure > last && pressure < layer_pressure(c));
        CHECK(layer_compression(pressure) < c);
        CHECK(fabs(slope / layer_contact_stiffness(c) - 1.0) < 0.02); /* its curve has small kinks */
        last = pressure;
    }
    CHECK(layer_contact_pressure(0.0) == 0.0 && layer_contact_stiffness(-1e-6) == 0.0);
}

static void every_way_to_the_permittivity_agrees(void)
{
    for (double pressure = 1e-3; pressure < 1.5e6; pressure *= 1.013) {
        const double rise = layer_permittivity_rise(pressure * TAXEL_PITCH_M * TAXEL_PITCH_M), c = layer_compression(pressure);
        CHECK(fabs(layer_pressure_rise(pressure) / rise - 1.0) < 3e-5);
        CHECK(fabs(layer_compression_rise(c) - rise) < 3e-5 * rise + 1e-7);
        CHECK(pressure < 1.0 || pressure > 2e5 || fabs(layer_pressure(c) / pressure - 1.0) < 1e-3);
    }
    CHECK(layer_compression(0.0) == 0.0 && layer_pressure_rise(0.0) == 0.0 && layer_compression_rise(0.0) == 0.0);
    CHECK(layer_compression_rise(1.0) == layer_compression_rise(0.00079));
}

static void pores_are_what_is_not_silicone(void)
{
    CHECK(fabs(layer_pores(0.0) - 0.65) < 1e-12);
    CHECK(fabs(layer_pores(layer_compression_rise(0.0004)) - 0.3) < 1e-5); /* half as high, twice the silicone */
    CHECK(layer_pores(1e3) == 0.0);
}

int main(void)
{
    layer_init();
    CHECK_EQUAL(patch_init(&patch, 3, 4, map, TAXELS, NULL), 0);
    RUN(force_is_pressure_times_area_and_pushes_the_board_away);
    RUN(the_stiffness_is_the_derivative_of_the_wrench);
    RUN(before_contact_there_are_gaps_and_no_force);
    RUN(an_object_that_is_far_does_nothing);
    RUN(pressure_stiffness_and_work_are_derivatives_of_each_other);
    RUN(the_whole_layer_gives_way_more_than_its_pillars);
    RUN(every_way_to_the_permittivity_agrees);
    RUN(pores_are_what_is_not_silicone);
    patch_free(&patch);
    return check_summary();
}
