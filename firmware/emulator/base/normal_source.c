#include "emulator/base/normal_source.h"

#include "emulator/base/polar.h"

#define INLINED __attribute__((always_inline))

/* Points (u, v) inside the unit circle, and s = u^2 + v^2. */
struct pairs {
    double u[NORMAL_SOURCE_PAIRS], v[NORMAL_SOURCE_PAIRS], s[NORMAL_SOURCE_PAIRS];
};

/* Initialise a source of standard normal random numbers. Sources with the same seed and different streams are
 * independent. */
void normal_source_init(struct normal_source *normals, uint64_t seed, uint64_t stream)
{
    random_init(&normals->source, seed, stream);
    normals->used = 2u * NORMAL_SOURCE_PAIRS; /* no number is ready: the first request computes a block */
}

/* Sample uniformly distributed points inside the unit circle. Each point is stored, and overwritten by the next one
 * unless it lies inside the circle. This avoids a branch that a processor would predict wrongly for one point in five.
 */
static void sample_pairs(struct random_source *source, struct pairs *pairs)
{
    struct random_source local = *source; /* lets the compiler keep the state in registers */
    for (unsigned count = 0; count < NORMAL_SOURCE_PAIRS;) {
        const double u = 2.0 * random_uniform(&local) - 1.0;
        const double v = 2.0 * random_uniform(&local) - 1.0;
        const double s = u * u + v * v;
        pairs->u[count] = u;
        pairs->v[count] = v;
        pairs->s[count] = s;
        count += (unsigned)(s < 1.0) & (unsigned)(s != 0.0);
    }
    *source = local;
}

/* Convert points in the unit circle to pairs of independent standard normal numbers (polar method). */
static inline INLINED void scale_pairs(const struct pairs *pairs, double *values)
{
    for (unsigned i = 0; i < NORMAL_SOURCE_PAIRS; i++) {
        /* NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage): sample_pairs() has assigned every element */
        const double factor = polar_factor(pairs->s[i]);
        values[2u * i] = pairs->u[i] * factor;
        values[2u * i + 1u] = pairs->v[i] * factor;
    }
}

#ifdef __x86_64__
/* The same operations as scale_pairs(), on four numbers at a time; the results are identical to the bit. */
__attribute__((target("avx2"))) static void scale_pairs_avx2(const struct pairs *pairs, double *values)
{
    scale_pairs(pairs, values);
}
#endif

/* Compute the next block of standard normal numbers with the polar method, with AVX2 instructions if the processor has
 * them. */
void normal_source_fill(struct normal_source *normals)
{
    struct pairs pairs;
    sample_pairs(&normals->source, &pairs);
    normals->used = 0;
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2")) {
        scale_pairs_avx2(&pairs, normals->values);
        return;
    }
#endif
    scale_pairs(&pairs, normals->values);
}
