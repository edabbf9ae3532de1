/* Intersection of lines with shapes: the computed entry distances compared with samples along the line. */
#include <math.h>

#include "check.h"
#include "emulator/base/random.h"
#include "emulator/geometry/shape.h"

#define SEED 7u
#define STEP_M 2e-5
#define RANGE_M 0.4

static const struct shape box = {
    .kind = SHAPE_CONVEX,
    .plane_count = 6,
    .planes = {{1, 0, 0, 0.03}, {-1, 0, 0, 0.03}, {0, 1, 0, 0.02}, {0, -1, 0, 0.02}, {0, 0, 1, 0.05}, {0, 0, -1, 0.0}},
};
static const struct shape prism = {
    .kind = SHAPE_CONVEX,
    .plane_count = 5,
    .planes = {{0.8660254037844386, 0.5, 0, 0.02},
               {-0.8660254037844386, 0.5, 0, 0.02},
               {0, -1, 0, 0.02},
               {0, 0, 1, 0.06},
               {0, 0, -1, 0}},
};
static const struct shape cylinder = {.kind = SHAPE_CYLINDER, .radius = 0.025, .height = 0.06};
static const struct shape *const shapes[] = {&box, &prism, &cylinder};
#define SHAPES (sizeof shapes / sizeof shapes[0])

/* Return whether the point p (metres) lies inside the shape, by the definition of the shape. */
static bool is_inside(const struct shape *shape, const double p[3])
{
    if (shape->kind == SHAPE_CYLINDER) {
        return hypot(p[0], p[1]) <= shape->radius && p[2] >= 0.0 && p[2] <= shape->height;
    }
    for (size_t i = 0; i < shape->plane_count; i++) {
        const double *n = shape->planes[i];
        if (n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > n[3]) {
            return false;
        }
    }
    return true;
}

/* Return the distance from the origin to the first sample inside the shape, from -RANGE_M on; INFINITY if there is
 * none. */
static double first_inside_point(const struct shape *shape, const double origin[3], const double direction[3])
{
    for (double distance = -RANGE_M; distance < RANGE_M; distance += STEP_M) {
        const double p[3] = {origin[0] + distance * direction[0], origin[1] + distance * direction[1],
                             origin[2] + distance * direction[2]};
        if (is_inside(shape, p)) {
            return distance;
        }
    }
    return (double)INFINITY;
}

/* Choose a random line: its origin near the shape (standard deviation `spread`, metres) and a direction of length 1. */
static void random_line(struct random_source *random, double spread, double origin[3], double direction[3])
{
    double length = 0.0;
    for (int k = 0; k < 3; k++) {
        origin[k] = spread * random_normal(random) + (k == 2 ? 0.03 : 0.0);
        direction[k] = random_normal(random);
        length += direction[k] * direction[k];
    }
    for (int k = 0; k < 3; k++) {
        direction[k] /= sqrt(length);
    }
}

static void entry_distances_agree_with_sampling_along_the_line(void)
{
    struct random_source random;
    double origin[3], direction[3];
    random_init(&random, SEED, 0);
    for (size_t s = 0; s < SHAPES; s++) {
        unsigned hits = 0, misses = 0;
        for (int n = 0; n < 60; n++) {
            random_line(&random, 0.03, origin, direction);
            const double entry = shape_entry(shapes[s], origin, direction),
                         sampled_entry = first_inside_point(shapes[s], origin, direction);
            if (isinf(sampled_entry)) {
                misses++;
                if (!isinf(entry)) { /* the line may cross an edge between two samples */
                    const double beyond[3] = {origin[0] + (entry + STEP_M) * direction[0],
                                              origin[1] + (entry + STEP_M) * direction[1],
                                              origin[2] + (entry + STEP_M) * direction[2]};
                    CHECK(!is_inside(shapes[s], beyond));
                }
            } else {
                hits++;
                CHECK_BETWEEN(sampled_entry - entry, -1e-12, STEP_M + 1e-12);
            }
        }
        CHECK(hits > 10 && misses > 5);
    }
}

static void a_line_from_inside_has_a_negative_entry_distance(void)
{
    static const double origin[3] = {0.0, 0.0, 0.02}, up[3] = {0.0, 0.0, 1.0}, x[3] = {1.0, 0.0, 0.0};
    CHECK(shape_entry(&box, origin, up) == -0.02);
    CHECK(shape_entry(&box, origin, x) == -0.03);
    CHECK(shape_entry(&cylinder, origin, up) == -0.02);
    CHECK(shape_entry(&cylinder, origin, x) == -0.025);
}

static void a_line_outside_the_shape_misses(void)
{
    static const double outside[3] = {0.1, 0.0, 0.02}, up[3] = {0.0, 0.0, 1.0}, y[3] = {0.0, 1.0, 0.0};
    for (size_t s = 0; s < SHAPES; s++) {
        CHECK(isinf(shape_entry(shapes[s], outside, up)));
        CHECK(isinf(shape_entry(shapes[s], outside, y)));
    }
}

static void grouped_lines_give_the_same_entries(void)
{
    struct random_source random;
    random_init(&random, SEED, 1);
    for (size_t s = 0; s < SHAPES; s++) {
        unsigned hits_within_reach = 0;
        for (int n = 0; n < 300; n++) {
            const double reach = n % 3 ? 0.01 : 1.0;
            struct shape_lines lines = {.radius = 0.004};
            double origin[SHAPE_LINES][3], direction[SHAPE_LINES][3], ignored[3];
            random_line(&random, 0.02, lines.middle, ignored);
            for (int i = 0; i < SHAPE_LINES; i++) {
                random_line(&random, 0.03, ignored, direction[i]);
                for (int k = 0; k < 3; k++) {
                    origin[i][k] = lines.middle[k] + 0.0023 * (2.0 * random_uniform(&random) - 1.0);
                    lines.origin[k][i] = origin[i][k];
                    lines.direction[k][i] = direction[i][k];
                }
            }
            shape_entries(shapes[s], &lines, reach);
            for (int i = 0; i < SHAPE_LINES; i++) {
                const double entry = shape_entry(shapes[s], origin[i], direction[i]);
                hits_within_reach += fabs(entry) <= reach;
                CHECK(lines.entry[i] == entry || (fabs(entry) > reach && fabs(lines.entry[i]) > reach));
            }
        }
        CHECK(hits_within_reach > 200);
    }
}

static void the_distance_bound_never_exceeds_the_distance(void)
{
    struct random_source random;
    double origin[3], direction[3];
    random_init(&random, SEED, 2);
    for (size_t s = 0; s < SHAPES; s++) {
        for (int n = 0; n < 2000; n++) {
            random_line(&random, 0.05, origin, direction);
            const double bound = shape_distance_bound(shapes[s], origin),
                         entry = shape_entry(shapes[s], origin, direction);
            CHECK(entry < 0.0 || entry >= bound - 1e-12);
            CHECK((bound <= 0.0) == is_inside(shapes[s], origin));
        }
    }
}

int main(void)
{
    printf("seed %u\n", SEED);
    RUN(entry_distances_agree_with_sampling_along_the_line);
    RUN(a_line_from_inside_has_a_negative_entry_distance);
    RUN(a_line_outside_the_shape_misses);
    RUN(grouped_lines_give_the_same_entries);
    RUN(the_distance_bound_never_exceeds_the_distance);
    return check_summary();
}
