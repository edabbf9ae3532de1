/* Lines against shapes: what is computed agrees with walking along the line. */
#include <math.h>

#include "check.h"
#include "emulator/random.h"
#include "emulator/skin/shape.h"

#define SEED 7u
#define STEP_M 2e-5
#define FARTHEST_M 0.4

static const struct shape box = {
    .kind = SHAPE_CONVEX,
    .plane_count = 6,
    .planes = {{1, 0, 0, 0.03}, {-1, 0, 0, 0.03}, {0, 1, 0, 0.02}, {0, -1, 0, 0.02}, {0, 0, 1, 0.05}, {0, 0, -1, 0.0}},
};
static const struct shape prism = {
    .kind = SHAPE_CONVEX,
    .plane_count = 5,
    .planes = {{0.8660254037844386, 0.5, 0, 0.02}, {-0.8660254037844386, 0.5, 0, 0.02}, {0, -1, 0, 0.02}, {0, 0, 1, 0.06}, {0, 0, -1, 0}},
};
static const struct shape cylinder = {.kind = SHAPE_CYLINDER, .radius = 0.025, .height = 0.06};
static const struct shape *const shapes[] = {&box, &prism, &cylinder};
#define SHAPES (sizeof shapes / sizeof shapes[0])

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

/* Distance of the first point inside, from -FARTHEST_M on; INFINITY for none. */
static double walk(const struct shape *shape, const double origin[3], const double direction[3])
{
    for (double at = -FARTHEST_M; at < FARTHEST_M; at += STEP_M) {
        const double p[3] = {origin[0] + at * direction[0], origin[1] + at * direction[1], origin[2] + at * direction[2]};
        if (is_inside(shape, p)) {
            return at;
        }
    }
    return (double)INFINITY;
}

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

static void entries_agree_with_a_walk_along_the_line(void)
{
    struct random_source random;
    double origin[3], direction[3];
    random_init(&random, SEED, 0);
    for (size_t s = 0; s < SHAPES; s++) {
        unsigned hits = 0, misses = 0;
        for (int n = 0; n < 60; n++) {
            random_line(&random, 0.03, origin, direction);
            const double entry = shape_entry(shapes[s], origin, direction), walked = walk(shapes[s], origin, direction);
            if (isinf(walked)) {
                misses++;
                if (!isinf(entry)) { /* it may pass an edge between two steps */
                    const double beyond[3] = {origin[0] + (entry + STEP_M) * direction[0], origin[1] + (entry + STEP_M) * direction[1],
                                              origin[2] + (entry + STEP_M) * direction[2]};
                    CHECK(!is_inside(shapes[s], beyond));
                }
            } else {
                hits++;
                CHECK_BETWEEN(walked - entry, -1e-12, STEP_M + 1e-12);
            }
        }
        CHECK(hits > 10 && misses > 5);
    }
}

static void a_line_from_inside_has_entered_already(void)
{
    static const double origin[3] = {0.0, 0.0, 0.02}, up[3] = {0.0, 0.0, 1.0}, x[3] = {1.0, 0.0, 0.0};
    CHECK(shape_entry(&box, origin, up) == -0.02);
    CHECK(shape_entry(&box, origin, x) == -0.03);
    CHECK(shape_entry(&cylinder, origin, up) == -0.02);
    CHECK(shape_entry(&cylinder, origin, x) == -0.025);
}

static void a_line_beside_the_shape_misses(void)
{
    static const double beside[3] = {0.1, 0.0, 0.02}, up[3] = {0.0, 0.0, 1.0}, y[3] = {0.0, 1.0, 0.0};
    for (size_t s = 0; s < SHAPES; s++) {
        CHECK(isinf(shape_entry(shapes[s], beside, up)));
        CHECK(isinf(shape_entry(shapes[s], beside, y)));
    }
}

static void many_lines_at_once_give_the_same(void)
{
    struct random_source random;
    random_init(&random, SEED, 1);
    for (size_t s = 0; s < SHAPES; s++) {
        unsigned within = 0;
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
                within += fabs(entry) <= reach;
                CHECK(lines.entry[i] == entry || (fabs(entry) > reach && fabs(lines.entry[i]) > reach));
            }
        }
        CHECK(within > 200);
    }
}

static void the_bound_of_the_distance_is_one(void)
{
    struct random_source random;
    double origin[3], direction[3];
    random_init(&random, SEED, 2);
    for (size_t s = 0; s < SHAPES; s++) {
        for (int n = 0; n < 2000; n++) {
            random_line(&random, 0.05, origin, direction);
            const double bound = shape_distance_bound(shapes[s], origin), entry = shape_entry(shapes[s], origin, direction);
            CHECK(entry < 0.0 || entry >= bound - 1e-12);
            CHECK((bound <= 0.0) == is_inside(shapes[s], origin));
        }
    }
}

int main(void)
{
    printf("seed %u\n", SEED);
    RUN(entries_agree_with_a_walk_along_the_line);
    RUN(a_line_from_inside_has_entered_already);
    RUN(a_line_beside_the_shape_misses);
    RUN(many_lines_at_once_give_the_same);
    RUN(the_bound_of_the_distance_is_one);
    return check_summary();
}
