#include "emulator/base/random.h"

#include "emulator/base/polar.h"

/* Return the next number of the generator splitmix64 (Steele et al., 2014), and advance its state. */
static uint64_t splitmix64(uint64_t *state)
{
    uint64_t z = (*state += 0x9E3779B97F4A7C15ull);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

/* Seed a generator. splitmix64 mixes seed and stream number, so that every pair of seed and stream gives an independent
 * sequence. */
void random_init(struct random_source *source, uint64_t seed, uint64_t stream)
{
    uint64_t state = seed;
    state = splitmix64(&state) ^ stream;
    for (int i = 0; i < 4; i++) {
        source->state[i] = splitmix64(&state);
    }
    source->has_spare = false;
}

/* Return a standard normal number. Marsaglia's polar method (1964) generates pairs; the second number of a pair is kept
 * for the next call. */
double random_normal(struct random_source *source)
{
    if (source->has_spare) {
        source->has_spare = false;
        return source->spare;
    }
    double u, v, s;
    do {
        u = 2.0 * random_uniform(source) - 1.0;
        v = 2.0 * random_uniform(source) - 1.0;
        s = u * u + v * v;
    } while (s >= 1.0 || s == 0.0);
    const double factor = polar_factor(s);
    source->spare = v * factor;
    source->has_spare = true;
    return u * factor;
}
