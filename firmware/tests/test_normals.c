/* Normal numbers: a block of them is what one at a time is, to the bit, and both are normal. */
#include "check.h"
#include "emulator/normals.h"
#include "emulator/polar.h"

#define COUNT 1000000

static struct random_source source;
static struct normals normals;

static void a_block_is_one_at_a_time_to_the_bit(void)
{
    for (uint64_t seed = 1; seed <= 3; seed++) {
        random_init(&source, seed, 7);
        normals_init(&normals, seed, 7);
        for (int i = 0; i < COUNT / 10; i++) {
            const double one = random_normal(&source), other = normals_next(&normals);
            if (!CHECK_BYTES(&other, &one, sizeof one)) {
                return;
            }
        }
    }
}

static void the_logarithm_is_the_c_librarys(void)
{
    double worst = 0.0;
    random_init(&source, 5, 0);
    for (int i = 0; i < COUNT; i++) {
        const double s = ldexp(random_uniform(&source) + 0x1.0p-53, -(int)(random_u64(&source) % 60u));
        const double exact = log(s);
        worst = fmax(worst, fabs(polar_log(s) - exact) / fmax(fabs(exact), 0x1.0p-53));
    }
    CHECK_BETWEEN(worst, 0.0, 4.0 * 0x1.0p-53);
    CHECK(polar_log(0.5) == log(0.5) && polar_log(0.25) == log(0.25));
}

static void moments_are_those_of_a_normal_distribution(void)
{
    double sum[5] = {0.0};
    unsigned beyond = 0;
    normals_init(&normals, 11, 0);
    for (int i = 0; i < COUNT; i++) {
        const double value = normals_next(&normals);
        double power = 1.0;
        for (int n = 1; n <= 4; n++) {
            power *= value;
            sum[n] += power / COUNT;
        }
        beyond += fabs(value) > 3.0;
    }
    /* Five standard errors of each: sqrt(var / n), var of x^n being 1, 2, 15 and 96. */
    CHECK_BETWEEN(sum[1], -0.005, 0.005);
    CHECK_BETWEEN(sum[2], 1.0 - 0.0071, 1.0 + 0.0071);
    CHECK_BETWEEN(sum[3], -0.0194, 0.0194);
    CHECK_BETWEEN(sum[4], 3.0 - 0.049, 3.0 + 0.049);
    CHECK_BETWEEN(beyond, 2700 - 260, 2700 + 260);
}

int main(void)
{
    RUN(a_block_is_one_at_a_time_to_the_bit);
    RUN(the_logarithm_is_the_c_librarys);
    RUN(moments_are_those_of_a_normal_distribution);
    return check_summary();
}
