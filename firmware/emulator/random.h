/* Random numbers that a seed repeats on every machine: splitmix64 to seed (Steele et al., 2014), xoshiro256++ to draw
 * (Blackman and Vigna, 2019). */
#ifndef EMULATOR_RANDOM_H
#define EMULATOR_RANDOM_H

#include <stdbool.h>
#include <stdint.h>

struct random_source {
    uint64_t state[4];
    double spare;
    bool has_spare;
};

/* A source of its own for each (seed, stream): the order in which streams are used changes nothing. */
void random_init(struct random_source *source, uint64_t seed, uint64_t stream);
double random_normal(struct random_source *source); /* mean 0, standard deviation 1 */

static inline uint64_t random_rotated(uint64_t value, int bits)
{
    return (value << bits) | (value >> (64 - bits));
}

static inline uint64_t random_u64(struct random_source *source)
{
    uint64_t *s = source->state;
    const uint64_t result = random_rotated(s[0] + s[3], 23) + s[0];
    const uint64_t t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = random_rotated(s[3], 45);
    return result;
}

/* [0, 1) */
static inline double random_uniform(struct random_source *source)
{
    return (double)(random_u64(source) >> 11) * 0x1.0p-53;
}

#endif
