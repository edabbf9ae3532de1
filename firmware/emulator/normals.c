#include "emulator/normals.h"

#include "emulator/polar.h"

#define INLINED __attribute__((always_inline))

struct pairs {
    double u[NORMALS_PAIRS], v[NORMALS_PAIRS], s[NORMALS_PAIRS];
};

void normals_init(struct normals *normals, uint64_t seed, uint64_t stream)
{
    random_init(&normals->source, seed, stream);
    normals->used = 2u * NORMALS_PAIRS;
}

/* Points of the unit disc. Each is written, and stays if it lies inside: a processor guesses one in five branches wrong here. */
static void draw(struct random_source *source, struct pairs *pairs)
{
    struct random_source own = *source;
    for (unsigned count = 0; count < NORMALS_PAIRS;) {
        const double u = 2.0 * random_uniform(&own) - 1.0;
        const double v = 2.0 * random_uniform(&own) - 1.0;
        const double s = u * u + v * v;
        pairs->u[count] = u;
        pairs->v[count] = v;
        pairs->s[count] = s;
        count += (unsigned)(s < 1.0) & (unsigned)(s != 0.0);
    }
    *source = own;
}

static inline INLINED void scale(const struct pairs *pairs, double *values)
{
    for (unsigned i = 0; i < NORMALS_PAIRS; i++) {
        const double factor = polar_factor(pairs->s[i]);
        values[2u * i] = pairs->u[i] * factor;
        values[2u * i + 1u] = pairs->v[i] * factor;
    }
}

#ifdef __x86_64__
/* The same operations, four at a time where the processor can: the same results to the bit. */
__attribute__((target("avx2"))) static void scale_wide(const struct pairs *pairs, double *values)
{
    scale(pairs, values);
}
#endif

void normals_fill(struct normals *normals)
{
    struct pairs pairs;
    draw(&normals->source, &pairs);
    normals->used = 0;
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2")) {
        scale_wide(&pairs, normals->values);
        return;
    }
#endif
    scale(&pairs, normals->values);
}
