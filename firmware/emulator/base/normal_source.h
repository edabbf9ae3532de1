/* Normally distributed random numbers, computed in blocks: the same numbers to the bit as random_normal() returns for
 * the same seed and stream, in a fraction of the time. */
#ifndef EMULATOR_BASE_NORMAL_SOURCE_H
#define EMULATOR_BASE_NORMAL_SOURCE_H

#include "emulator/base/random.h"

#define NORMAL_SOURCE_PAIRS 32u

struct normal_source {
    struct random_source source; /* no other code may take numbers from this source */
    unsigned used;               /* values of the block that have been returned */
    double values[2u * NORMAL_SOURCE_PAIRS];
};

void normal_source_init(struct normal_source *normals, uint64_t seed, uint64_t stream);

/* Compute the next block. Only for normal_source_sample(). */
void normal_source_fill(struct normal_source *normals);

/* Return the next random number of a normal distribution with mean 0 and standard deviation 1. */
static inline double normal_source_sample(struct normal_source *normals)
{
    if (normals->used == 2u * NORMAL_SOURCE_PAIRS) {
        normal_source_fill(normals);
    }
    return normals->values[normals->used++];
}

#endif
