/* Pressure on the cells of a square: the calculation for sixteen cells at a time agrees with that for one cell. */
#include <math.h>

#include "check.h"
#include "emulator/base/random.h"
#include "emulator/geometry/cover_whole.h"
#include "emulator/geometry/frame.h"
#include "emulator/physics/layer.h"

#define SEED 11u
#define SQUARES 10000
#define DEEPEST_M 0.006

static const struct shape block = {
    .kind = SHAPE_CONVEX,
    .plane_count = 7,
    .planes = {{0, 0, 1, 0},
               {0, 0, -1, 0.1},
               {1, 0, 0, 0.002},
               {-1, 0, 0, 0.2},
               {0, 1, 0, 0.2},
               {0, -1, 0, 0.2},
               {0.6, 0, 0.8, 0.0008}}, /* the last plane cuts an edge off */
};
static const struct shape rod = {.kind = SHAPE_CYLINDER, .radius = 0.008, .height = 0.1};
static struct random_source source;

/* Return a random number between `low` and `high`. */
static double between(double low, double high)
{
    return low + (high - low) * random_uniform(&source);
}

/* Return a square with sides of 5 mm at a pose, whose cells are bent about one axis. `bend`: curvature in 1/m. */
static struct cover_square place_square(const struct frame *pose, double bend)
{
    struct cover_square square;
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double a = 0.00125 * (1.5 - i / 4), b = 0.00125 * (1.5 - i % 4), angle = bend * a;
        const double top[3] = {a, b, -0.5 * bend * a * a}, normal[3] = {sin(angle), 0.0, cos(angle)};
        const double half[2][3] = {{0.000625 * cos(angle), 0.0, -0.000625 * sin(angle)}, {0.0, 0.000625, 0.0}};
        double turned[4][3];
        frame_point(pose, top, turned[0]);
        frame_direction(pose, normal, turned[1]);
        frame_direction(pose, half[0], turned[2]);
        frame_direction(pose, half[1], turned[3]);
        for (int k = 0; k < 3; k++) {
            square.top[k][i] = turned[0][k];
            square.normal[k][i] = turned[1][k];
            square.half[0][k][i] = turned[2][k];
            square.half[1][k][i] = turned[3][k];
        }
    }
    return square;
}

/* Return the cell number `i` of a square. */
static struct cover_cell get_cell(const struct cover_square *square, int i)
{
    struct cover_cell cell;
    for (int k = 0; k < 3; k++) {
        cell.top[k] = square->top[k][i];
        cell.normal[k] = square->normal[k][i];
        cell.half[0][k] = square->half[0][k][i];
        cell.half[1][k] = square->half[1][k][i];
    }
    return cell;
}

/* Return whether a value equals the expected value except for rounding. */
static bool is_near(double value, double expected)
{
    return fabs(value - expected) <= 1e-9 * fabs(expected) + 1e-12;
}

/* Compare the loads of all cells of a square. Returns the number of whole cells. */
static int compare_square(const struct shape *shape, const struct cover_square *square, const double middle[3])
{
    struct cover_planes planes;
    struct cover_whole whole;
    bool touched[SHAPE_LINES];
    int count = 0;
    cover_find_planes(shape, middle, 0.006, DEEPEST_M, &planes);
    const double distance = cover_find_touched(shape, &planes, square, touched);
    cover_press_whole(shape, &planes, square, touched, &whole);
    for (int i = 0; i < SHAPE_LINES; i++) {
        struct cover_load faces[COVER_FACES_MAX];
        const struct cover_cell cell = get_cell(square, i);
        const size_t number = cover_press(shape, &planes, &cell, faces);
        const bool is_whole = number == 1 && faces[0].share == 1.0;
        CHECK(touched[i] || number == 0);
        CHECK(distance == 0.0 || number == 0);
        CHECK(whole.is_whole[i] == is_whole || (number == 1 && fabs(faces[0].share - 1.0) < 1e-9));
        if (whole.is_whole[i] && number == 1) {
            CHECK(is_near(whole.pressure[i], faces[0].pressure) && is_near(whole.rate[i], faces[0].rate));
            CHECK(is_near(whole.centre[0][i], faces[0].centre[0]) && is_near(whole.centre[1][i], faces[0].centre[1]));
            CHECK(is_near(whole.depth[i], faces[0].face.depth) && is_near(whole.steep[i], faces[0].face.steep));
            CHECK(is_near(whole.normal[0][i], faces[0].face.normal[0]));
            count++;
        }
    }
    return count;
}

static void whole_cells_on_a_block_have_the_loads_of_single_cells(void)
{
    int count = 0;
    for (int n = 0; n < SQUARES; n++) {
        const double middle[3] = {between(-0.006, 0.006), between(-0.02, 0.02), between(-0.002, 0.001)};
        const double turn[3] = {3.14159 + between(-0.3, 0.3), between(-0.3, 0.3), between(-0.3, 0.3)};
        const struct frame pose = frame_of_offset(middle, turn);
        const struct cover_square square = place_square(&pose, between(-50.0, 50.0));
        count += compare_square(&block, &square, middle);
    }
    CHECK(count > SQUARES);
}

static void whole_cells_on_a_rod_have_the_loads_of_single_cells(void)
{
    int count = 0;
    for (int n = 0; n < SQUARES; n++) {
        const double middle[3] = {0.008 + between(-0.002, 0.001), between(-0.004, 0.004), between(-0.004, 0.02)};
        const double turn[3] = {between(-0.4, 0.4), -1.5708 + between(-0.4, 0.4), between(-0.4, 0.4)};
        const struct frame pose = frame_of_offset(middle, turn);
        const struct cover_square square = place_square(&pose, between(-50.0, 50.0));
        count += compare_square(&rod, &square, middle);
    }
    CHECK(count > SQUARES);
}

/* After a motion that is shorter than the computed distance, in any direction, a square does not touch. */
static void the_distance_of_an_untouched_square_is_a_lower_bound(void)
{
    int count = 0;
    for (int n = 0; n < SQUARES; n++) {
        const struct shape *shape = n % 2 ? &block : &rod;
        const double middle[3] = {between(-0.02, 0.02), between(-0.02, 0.02), between(-0.01, 0.01)};
        const double turn[3] = {between(-3.0, 3.0), between(-3.0, 3.0), between(-3.0, 3.0)};
        struct frame pose = frame_of_offset(middle, turn);
        struct cover_square square = place_square(&pose, 20.0);
        struct cover_planes planes;
        bool touched[SHAPE_LINES];
        cover_find_planes(shape, middle, 0.006, DEEPEST_M, &planes);
        const double distance = cover_find_touched(shape, &planes, &square, touched);
        double shift[3], length = 0.0;
        for (int k = 0; k < 3; k++) {
            shift[k] = random_normal(&source);
            length += shift[k] * shift[k];
        }
        for (int k = 0; k < 3; k++) {
            pose.row[k][3] += 0.999 * distance * shift[k] / sqrt(length);
        }
        square = place_square(&pose, 20.0);
        const double moved[3] = {pose.row[0][3], pose.row[1][3], pose.row[2][3]};
        cover_find_planes(shape, moved, 0.006, DEEPEST_M, &planes);
        cover_find_touched(shape, &planes, &square, touched);
        for (int i = 0; distance > 0.0 && i < SHAPE_LINES; i++) {
            CHECK(!touched[i]);
        }
        count += distance > 0.0;
    }
    CHECK(count > SQUARES / 4);
}

int main(void)
{
    printf("seed %u\n", SEED);
    layer_init();
    random_init(&source, SEED, 0);
    RUN(whole_cells_on_a_block_have_the_loads_of_single_cells);
    RUN(whole_cells_on_a_rod_have_the_loads_of_single_cells);
    RUN(the_distance_of_an_untouched_square_is_a_lower_bound);
    return check_summary();
}
