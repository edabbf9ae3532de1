/* Random numbers that are identical for a seed on every machine: splitmix64 computes the initial state (Steele et al.,
 * 2014), xoshiro256++ generates the numbers (Blackman and Vigna, 2019). */
#ifndef EMULATOR_BASE_RANDOM_H
#define EMULATOR_BASE_RANDOM_H

#include <stdbool.h>
#include <stdint.h>

struct random_source {
    uint64_t state[4];
    double spare; /* second number of the last pair of random_normal() */
    bool has_spare;
};

/* Start the sequence of a pair (seed, stream). Sequences are independent: the order in which streams are used does not
 * change their numbers. */
void random_init(struct random_source *source, uint64_t seed, uint64_t stream);

/* Return a normally distributed number: mean 0, standard deviation 1. */
double random_normal(struct random_source *source);

/* Return `value` rotated left by `bits` (1 to 63). */
static inline uint64_t random_rotate_left(uint64_t value, int bits)
{
    return (value << bits) | (value >> (64 - bits));
}

/* Return a number with 64 random bits. */
static inline uint64_t random_u64(struct random_source *source)
{
    uint64_t *s = source->state;
    const uint64_t result = random_rotate_left(s[0] + s[3], 23) + s[0];
    const uint64_t t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = random_rotate_left(s[3], 45);
    return result;
}

/* Return a number that is uniformly distributed in [0, 1), with 53 random bits. */
static inline double random_uniform(struct random_source *source)
{
    return (double)(random_u64(source) >> 11) * 0x1.0p-53;
}

#endif
