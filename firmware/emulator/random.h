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
uint64_t random_u64(struct random_source *source);
double random_uniform(struct random_source *source); /* [0, 1) */
double random_normal(struct random_source *source);  /* mean 0, standard deviation 1 */

#endif
