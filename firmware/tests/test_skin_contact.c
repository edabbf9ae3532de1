/* Contact of a flat board with a flat object, and the curves of the layer. */
#include <math.h>
#include <string.h>

#include "check.h"
#include "emulator/physics/layer.h"
#include "emulator/geometry/contact.h"

#define TAXELS 12u
#define THICKNESS_M 0.001
#define DEPTH_M 0.0002
#define CELLS (TAXELS * CELLS_PER_TAXEL)
#define MOTION 1e-7 /* finite difference in metres and radians */

static const uint8_t map[TAXEL_CROSSING_MAP_SIZE] = {0xFF, 0x0F};
static const struct shape table = {
    .kind = SHAPE_CONVEX,
    .bound = 0.3,
    .plane_count = 6,
    .planes = {{0, 0, 1, 0}, {0, 0, -1, 0.1}, {1, 0, 0, 0.2}, {-1, 0, 0, 0.2}, {0, 1, 0, 0.2}, {0, -1, 0, 0.2}},
};
static struct patch patch;
static double compression[CELLS], gap[CELLS];

/* Return the pose of the board face down over the table with a gap of `height` (negative: indented). */
static struct frame board_over_table(double height)
{
    const double translation[3] = {0.0, 0.0, THICKNESS_M + height}, upside_down[3] = {3.141592653589793, 0.0, 0.0};
    return frame_of_offset(translation, upside_down);
}

static void the_contact_force_is_pressure_times_area(void)
{
    const struct frame frame = board_over_table(-DEPTH_M);
    struct contact_load load;
    CHECK(contact_solve(&patch, &table, &frame, THICKNESS_M, CONTACT_FAR_M, compression, gap, &load, NULL));
    for (size_t i = 0; i < CELLS; i++) {
        CHECK(fabs(compression[i] - DEPTH_M) < 1e-12);
        CHECK(gap[i] == 0.0);
    }
    const double force = layer_contact_pressure(DEPTH_M) * TAXELS * TAXEL_PITCH_M * TAXEL_PITCH_M;
    CHECK(fabs(load.wrench[2] / -force - 1.0) < 1e-9); /* the board's normal, z, points to the table */
    CHECK(fabs(load.wrench[0]) < 1e-12 && fabs(load.wrench[1]) < 1e-12);
}

static void the_stiffness_is_the_derivative_of_the_wrench(void)
{
    const struct frame frame = board_over_table(-DEPTH_M);
    struct contact_load load, shifted_load[2];
    CHECK(contact_solve(&patch, &table, &frame, THICKNESS_M, 0.0, compression, NULL, &load, NULL));
    for (int motion = 0; motion < 6; motion++) {
        double scale = 0.0;
        for (int s = 0; s < 2; s++) {
            double step[6] = {0.0};
            step[motion] = s ? MOTION : -MOTION;
            const struct frame motion_frame = frame_of_offset(step, step + 3),
                               moved_frame = frame_product(&frame, &motion_frame);
            CHECK(contact_solve(&patch, &table, &moved_frame, THICKNESS_M, 0.0, compression, NULL, &shifted_load[s],
                                NULL));
        }
        for (int i = 0; i < 6; i++) {
            scale = fmax(scale, fabs(load.stiffness[i][motion]));
        }
        for (int i = 0; i < 6; i++) {
            const double slope = (shifted_load[1].wrench[i] - shifted_load[0].wrench[i]) / (2.0 * MOTION);
            CHECK(fabs(slope + load.stiffness[i][motion]) <= 1e-5 * scale + 1e-6);
        }
    }
}

static void before_contact_gaps_are_computed_and_the_force_is_zero(void)
{
    const struct frame frame = board_over_table(0.003);
    struct contact_load load;
    CHECK(!contact_solve(&patch, &table, &frame, THICKNESS_M, 0.01, compression, gap, &load, NULL));
    for (size_t i = 0; i < CELLS; i++) {
        CHECK(compression[i] == 0.0 && fabs(gap[i] - 0.003) < 1e-12);
    }
    CHECK(load.wrench[2] == 0.0 && load.stiffness[2][2] == 0.0);
    CHECK(!contact_solve(&patch, &table, &frame, THICKNESS_M, 0.002, compression, gap, NULL, NULL));
    CHECK(gap[0] == CONTACT_FAR_M); /* beyond the requested reach */
}

static void a_distant_object_has_no_effect(void)
{
    struct frame frame = board_over_table(0.5);
    struct contact_load load;
    CHECK(contact_is_far(&patch, &table, &frame, CONTACT_FAR_M));
    CHECK(!contact_solve(&patch, &table, &frame, THICKNESS_M, CONTACT_FAR_M, compression, gap, &load, NULL));
    for (size_t i = 0; i < CELLS; i++) {
        CHECK(compression[i] == 0.0 && gap[i] == CONTACT_FAR_M);
    }
    CHECK(load.wrench[2] == 0.0);
    frame = board_over_table(-DEPTH_M);
    CHECK(!contact_is_far(&patch, &table, &frame, 0.0));
}

static void pressure_stiffness_and_work_are_derivatives_of_each_other(void)
{
    for (double c = 1e-5; c < 0.0006; c += 3.1e-6) {
        const double step = 1e-9;
        const double slope = (layer_pressure(c + step) - layer_pressure(c - step)) / (2.0 * step);
        const double gain = (layer_work(c + step) - layer_work(c - step)) / (2.0 * step);
        /* one kink at the start of the linear part */
        CHECK(fabs(slope / layer_stiffness(c) - 1.0) < 2e-4 || c > 0.00051);
        CHECK(fabs(gain / layer_pressure(c) - 1.0) < 1e-5);
    }
    CHECK(layer_pressure(-1e-6) == 0.0 && layer_stiffness(0.0) == 0.0 && layer_work(0.0) == 0.0);
}

/* The pillars and the sheet below them have the same pressure, and their compressions add. */
static void the_whole_layer_is_more_compliant_than_its_pillars(void)
{
    double last = 0.0;
    for (double c = 1e-6; c < 0.0006; c *= 1.02) {
        const double pressure = layer_contact_pressure(c), step = 1e-5 * c;
        const double slope = (layer_contact_pressure(c + step) - layer_contact_pressure(c - step)) / (2.0 * step);
        CHECK(pressure > last && pressure < layer_pressure(c));
        CHECK(layer_compression(pressure) < c);
        CHECK(fabs(slope / layer_contact_stiffness(c) - 1.0) < 0.02); /* the curve has small kinks */
        last = pressure;
    }
    CHECK(layer_contact_pressure(0.0) == 0.0 && layer_contact_stiffness(-1e-6) == 0.0);
}

static void the_compression_is_the_inverse_of_the_contact_pressure(void)
{
    for (double c = 1e-7; c < 0.0025; c *= 1.03) {
        CHECK(fabs(layer_contact_compression(layer_contact_pressure(c)) / c - 1.0) < 1e-7);
    }
    CHECK(layer_contact_compression(0.0) == 0.0);
}

static void all_functions_for_the_capacitance_rise_agree(void)
{
    for (double pressure = 1e-3; pressure < 1.5e6; pressure *= 1.013) {
        const double rise = layer_rise_at_force(pressure * TAXEL_PITCH_M * TAXEL_PITCH_M),
                     c = layer_compression(pressure);
        CHECK(fabs(layer_rise_at_pressure(pressure) / rise - 1.0) < 3e-5);
        CHECK(fabs(layer_rise_at_compression(c) - rise) < 3e-5 * rise + 1e-7);
        CHECK(pressure < 1.0 || pressure > 2e5 || fabs(layer_pressure(c) / pressure - 1.0) < 1e-3);
    }
    CHECK(layer_compression(0.0) == 0.0 && layer_rise_at_pressure(0.0) == 0.0 && layer_rise_at_compression(0.0) == 0.0);
    CHECK(layer_rise_at_compression(1.0) == layer_rise_at_compression(0.00079));
}

static void the_air_fraction_excludes_the_silicone(void)
{
    CHECK(fabs(layer_air_fraction(0.0) - 0.65) < 1e-12);
    /* half the height: twice the silicone fraction */
    CHECK(fabs(layer_air_fraction(layer_rise_at_compression(0.0004)) - 0.3) < 1e-5);
    CHECK(layer_air_fraction(1e3) == 0.0);
}

static double stuck[CELLS];
static double point[CELLS][3], due[TAXELS], untouched[TAXELS];

/* Return the friction state of the board without earlier contacts. */
static struct contact_grip start_grip(void)
{
    memset(stuck, 0, sizeof stuck);
    return (struct contact_grip){
        .coefficient = 0.5, .advances = true, .stuck = stuck, .point = point, .due = due, .untouched = untouched};
}

/* Return the load of the board after a shift along x (metres) from its first contact, in steps of 10 micrometres. */
static struct contact_load load_after_shift(struct contact_grip *grip, double shift)
{
    struct contact_load load;
    const int steps = 1 + (int)(shift / 1e-5 + 0.5);
    for (int step = 0; step < steps; step++) {
        struct frame frame = board_over_table(-DEPTH_M);
        frame.row[0][3] += step * 1e-5;
        CHECK(contact_solve(&patch, &table, &frame, THICKNESS_M, 0.0, compression, NULL, &load, grip));
    }
    return load;
}

static void the_skin_sticks_like_a_spring_and_slides_at_the_friction_limit(void)
{
    const double area = TAXELS * TAXEL_PITCH_M * TAXEL_PITCH_M;
    const double pressing = layer_contact_pressure(DEPTH_M) * area;
    struct contact_grip grip = start_grip();
    const struct contact_load shifted = load_after_shift(&grip, 5e-5);
    CHECK(fabs(shifted.wrench[0] / (-5e-5 * layer_shear_stiffness() * area) - 1.0) < 1e-9);
    CHECK(fabs(shifted.wrench[2] / -pressing - 1.0) < 1e-9);
    CHECK(fabs(shifted.stiffness[0][0] / (layer_shear_stiffness() * area) - 1.0) < 1e-9);
    grip = start_grip();
    const struct contact_load slid = load_after_shift(&grip, 5e-3);
    CHECK(fabs(slid.wrench[0] / (-grip.coefficient * pressing) - 1.0) < 1e-6);
    CHECK(fabs(slid.stiffness[0][0]) < 1e-6 * layer_shear_stiffness() * area); /* no resistance along the sliding */
}

static void a_solution_that_does_not_advance_leaves_the_sticking_points_unchanged(void)
{
    struct contact_grip grip = start_grip();
    load_after_shift(&grip, 0.0);
    grip.advances = false;
    const struct contact_load first = load_after_shift(&grip, 3e-3), second = load_after_shift(&grip, 3e-3);
    CHECK(memcmp(first.wrench, second.wrench, sizeof first.wrench) == 0);
    CHECK(first.wrench[0] < 0.0);
}

/* A block whose side face lies at x = 0 enters the layer from the side, 0.8 mm deep. The force begins at zero, pushes
 * the block back until its bottom is nearer than its side, and never exceeds that of a steep face. */
static void an_object_that_enters_from_the_side_is_loaded_gradually(void)
{
    struct shape block = table;
    block.planes[2][3] = 0.0;
    block.planes[3][3] = 0.1;
    const double row = TAXELS / 3 * TAXEL_PITCH_M * TAXEL_PITCH_M / CELLS_PER_SIDE; /* area of one row of cells */
    const double largest = 2.0 * layer_contact_pressure(0.0008) * row;
    struct contact_grip grip = start_grip();
    struct contact_load load = {.wrench = {0.0}};
    double previous = 0.0, pushed_back = 0.0;
    int touching_rows = 0;
    for (int step = 0; step < 400; step++) {
        struct frame frame = board_over_table(-0.0008);
        frame.row[0][3] = 0.0125 - step * 1e-5;
        const bool touches = contact_solve(&patch, &block, &frame, THICKNESS_M, 0.0, compression, NULL, &load, &grip);
        const double force = sqrt(load.wrench[0] * load.wrench[0] + load.wrench[2] * load.wrench[2]);
        touching_rows += touches && previous == 0.0;
        CHECK(!touches || previous > 0.0 || force < 0.05 * largest);
        CHECK(force < 1.5 * largest * (1 + step / 125.0));
        pushed_back = fmax(pushed_back, load.wrench[0]);
        previous = force;
    }
    CHECK_EQUAL(touching_rows, 1);
    CHECK(pushed_back > 0.5 * largest);
    CHECK(-load.wrench[2] > 0.9 * largest); /* at least two of the rows are compressed by the bottom of the block */
}

/* Press a block 0.8 mm deep into the layer, without friction. Its side face is at x = `edge` (board frame, metres), and
 * it is turned by `angle` (rad) about the vertical. Returns the load. */
static struct contact_load press_edge(double edge, double angle)
{
    struct shape block = table;
    block.planes[2][0] = cos(angle);
    block.planes[2][1] = sin(angle);
    block.planes[2][3] = 0.0;
    struct frame frame = board_over_table(-0.0008);
    frame.row[0][3] = -edge;
    struct contact_load load;
    struct contact_grip grip = start_grip();
    grip.coefficient = 0.0;
    CHECK(contact_solve(&patch, &block, &frame, THICKNESS_M, 0.0, compression, NULL, &load, &grip));
    return load;
}

/* The normal force is proportional to the covered area, less a strip at the edge that the steep side face limits,
 * wherever the edge crosses the cells. */
static void the_load_is_continuous_in_the_position_of_an_edge(void)
{
    const double pressure = layer_contact_pressure(0.0008), width = 4 * TAXEL_PITCH_M;
    double previous = 0.0;
    for (int step = 0; step < 300; step++) {
        const struct contact_load load = press_edge(-0.0115 + 4e-5 * step, 0.0);
        if (step) {
            CHECK(fabs(fabs(load.wrench[2] - previous) / (pressure * width * 4e-5) - 1.0) < 1e-6);
        }
        previous = load.wrench[2];
    }
    for (int step = 0; step < 200; step++) { /* an oblique edge crosses corners of cells */
        const struct contact_load load = press_edge(-0.0075 + 4e-5 * step, 0.5);
        CHECK(!step || fabs(load.wrench[2] - previous) < 1.2 * pressure * width / cos(0.5) * 4e-5);
        previous = load.wrench[2];
    }
}

static void squares_that_were_far_are_found_when_the_board_returns(void)
{
    struct contact_grip grip = start_grip();
    for (int step = 0; step < 200; step++) {
        const double height = 0.02 * cos(step * 0.2) + 0.018;
        const struct frame frame = board_over_table(height);
        struct contact_load load, expected;
        const bool touches = contact_solve(&patch, &table, &frame, THICKNESS_M, 0.0, compression, NULL, &load, &grip);
        CHECK(touches == contact_solve(&patch, &table, &frame, THICKNESS_M, 0.0, compression, NULL, &expected, NULL));
        CHECK(touches == (height < 0.0));
        CHECK(fabs(load.wrench[2] - expected.wrench[2]) < 1e-9);
        CHECK(load.clearance <= fmax(height, 0.0) + 1e-12);
    }
}

int main(void)
{
    layer_init();
    CHECK_EQUAL(patch_init(&patch, 3, 4, map, TAXELS, NULL), 0);
    RUN(the_contact_force_is_pressure_times_area);
    RUN(the_stiffness_is_the_derivative_of_the_wrench);
    RUN(before_contact_gaps_are_computed_and_the_force_is_zero);
    RUN(a_distant_object_has_no_effect);
    RUN(pressure_stiffness_and_work_are_derivatives_of_each_other);
    RUN(the_whole_layer_is_more_compliant_than_its_pillars);
    RUN(the_compression_is_the_inverse_of_the_contact_pressure);
    RUN(all_functions_for_the_capacitance_rise_agree);
    RUN(the_air_fraction_excludes_the_silicone);
    RUN(the_skin_sticks_like_a_spring_and_slides_at_the_friction_limit);
    RUN(a_solution_that_does_not_advance_leaves_the_sticking_points_unchanged);
    RUN(an_object_that_enters_from_the_side_is_loaded_gradually);
    RUN(the_load_is_continuous_in_the_position_of_an_edge);
    RUN(squares_that_were_far_are_found_when_the_board_returns);
    patch_free(&patch);
    return check_summary();
}
