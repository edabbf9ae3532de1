/* Normally distributed random numbers: blocks equal single numbers to the bit, and the distribution is correct. */
#include "check.h"
#include "emulator/base/normal_source.h"
#include "emulator/base/polar.h"

#define COUNT 1000000

static struct random_source source;
static struct normal_source normals;

static void blocks_equal_single_numbers_to_the_bit(void)
{
    for (uint64_t seed = 1; seed <= 3; seed++) {
        random_init(&source, seed, 7);
        normal_source_init(&normals, seed, 7);
        for (int i = 0; i < COUNT / 10; i++) {
            const double single = random_normal(&source), from_block = normal_source_sample(&normals);
            if (!CHECK_BYTES(&from_block, &single, sizeof single)) {
                return;
            }
        }
    }
}

static void the_logarithm_agrees_with_the_c_library(void)
{
    double largest_error = 0.0;
    random_init(&source, 5, 0);
    for (int i = 0; i < COUNT; i++) {
        const double s = ldexp(random_uniform(&source) + 0x1.0p-53, -(int)(random_u64(&source) % 60u));
        const double exact = log(s);
        largest_error = fmax(largest_error, fabs(polar_log(s) - exact) / fmax(fabs(exact), 0x1.0p-53));
    }
    CHECK_BETWEEN(largest_error, 0.0, 4.0 * 0x1.0p-53);
    CHECK(polar_log(0.5) == log(0.5) && polar_log(0.25) == log(0.25));
}

static void the_moments_equal_those_of_a_normal_distribution(void)
{
    double moment[5] = {0.0};
    unsigned outside_three_sigma = 0;
    normal_source_init(&normals, 11, 0);
    for (int i = 0; i < COUNT; i++) {
        const double value = normal_source_sample(&normals);
        double power = 1.0;
        for (int n = 1; n <= 4; n++) {
            power *= value;
            moment[n] += power / COUNT;
        }
        outside_three_sigma += fabs(value) > 3.0;
    }
    /* The bounds are five standard errors sqrt(variance / COUNT); the variances of x, x^2, x^3 and x^4 are 1, 2, 15 and
     * 96. */
    CHECK_BETWEEN(moment[1], -0.005, 0.005);
    CHECK_BETWEEN(moment[2], 1.0 - 0.0071, 1.0 + 0.0071);
    CHECK_BETWEEN(moment[3], -0.0194, 0.0194);
    CHECK_BETWEEN(moment[4], 3.0 - 0.049, 3.0 + 0.049);
    CHECK_BETWEEN(outside_three_sigma, 2700 - 260, 2700 + 260);
}

int main(void)
{
    RUN(blocks_equal_single_numbers_to_the_bit);
    RUN(the_logarithm_agrees_with_the_c_library);
    RUN(the_moments_equal_those_of_a_normal_distribution);
    return check_summary();
}
