/* Rigid transforms. */
#include <math.h>

#include "check.h"
#include "emulator/base/random.h"
#include "emulator/geometry/frame.h"

#define SEED 5u
#define HALF_PI 1.5707963267948966

/* Return the largest difference between the elements of two rigid transforms. */
static double max_difference(const struct frame *a, const struct frame *b)
{
    double difference = 0.0;
    for (int i = 0; i < 12; i++) {
        difference = fmax(difference, fabs(a->row[i / 4][i % 4] - b->row[i / 4][i % 4]));
    }
    return difference;
}

/* Return a random rigid transform. */
static struct frame random_frame(struct random_source *random)
{
    double translation[3], rotation[3];
    for (int k = 0; k < 3; k++) {
        translation[k] = random_normal(random);
        rotation[k] = random_normal(random);
    }
    return frame_of_offset(translation, rotation);
}

static void a_quarter_turn_about_z_maps_x_to_y(void)
{
    static const double translation[3] = {1.0, 2.0, 3.0}, quarter[3] = {0.0, 0.0, HALF_PI}, x[3] = {1.0, 0.0, 0.0};
    const struct frame frame = frame_of_offset(translation, quarter);
    double point[3], direction[3];
    frame_point(&frame, x, point);
    frame_direction(&frame, x, direction);
    CHECK(fabs(point[0] - 1.0) < 1e-15 && fabs(point[1] - 3.0) < 1e-15 && fabs(point[2] - 3.0) < 1e-15);
    CHECK(fabs(direction[0]) < 1e-15 && fabs(direction[1] - 1.0) < 1e-15 && fabs(direction[2]) < 1e-15);
}

static void a_zero_offset_is_the_identity(void)
{
    static const double nothing[3] = {0.0, 0.0, 0.0}, little[3] = {1e-9, 0.0, 0.0};
    struct frame frame = frame_of_offset(nothing, nothing);
    CHECK(max_difference(&frame, &frame_identity) == 0.0);
    frame = frame_of_offset(nothing, little);
    CHECK(fabs(frame.row[2][1] - 1e-9) < 1e-24);
}

static void a_frame_times_its_inverse_is_the_identity(void)
{
    struct random_source random;
    random_init(&random, SEED, 0);
    for (int n = 0; n < 100; n++) {
        const struct frame frame = random_frame(&random), inverse = frame_inverse(&frame);
        const struct frame left = frame_product(&inverse, &frame), right = frame_product(&frame, &inverse);
        CHECK(max_difference(&left, &frame_identity) < 1e-14);
        CHECK(max_difference(&right, &frame_identity) < 1e-14);
    }
}

static void a_product_equals_its_factors_applied_in_sequence(void)
{
    struct random_source random;
    random_init(&random, SEED, 1);
    for (int n = 0; n < 100; n++) {
        const struct frame a = random_frame(&random), b = random_frame(&random), both = frame_product(&a, &b);
        const double in[3] = {random_normal(&random), random_normal(&random), random_normal(&random)};
        double once[3], twice[3], direct[3];
        frame_point(&b, in, once);
        frame_point(&a, once, twice);
        frame_point(&both, in, direct);
        for (int k = 0; k < 3; k++) {
            CHECK(fabs(twice[k] - direct[k]) < 1e-13);
        }
    }
}

static void the_rotation_vector_of_a_frame_makes_the_same_frame(void)
{
    static const double nothing[3] = {0.0, 0.0, 0.0};
    struct random_source random;
    random_init(&random, SEED, 3);
    for (int n = 0; n < 300; n++) {
        struct frame frame = random_frame(&random);
        double vector[3];
        if (n % 3 == 0) { /* a turn by almost half a revolution */
            const double half[3] = {n % 9 == 0 ? 3.14159 : 0.001, n % 9 == 3 ? 3.14159 : 0.002,
                                    n % 9 == 6 ? 3.14159 : 0.0};
            frame = frame_of_offset(nothing, half);
        }
        frame_rotation_vector(&frame, vector);
        struct frame again = frame_of_offset(nothing, vector);
        for (int k = 0; k < 3; k++) {
            again.row[k][3] = frame.row[k][3];
        }
        CHECK(max_difference(&frame, &again) < 1e-14);
        CHECK(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2] < 9.8697);
    }
}

int main(void)
{
    printf("seed %u\n", SEED);
    RUN(a_quarter_turn_about_z_maps_x_to_y);
    RUN(a_zero_offset_is_the_identity);
    RUN(a_frame_times_its_inverse_is_the_identity);
    RUN(the_rotation_vector_of_a_frame_makes_the_same_frame);
    RUN(a_product_equals_its_factors_applied_in_sequence);
    return check_summary();
}
