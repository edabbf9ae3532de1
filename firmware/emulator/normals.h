/* Normal numbers by the block: those that random_normal() draws from the same source, to the bit, at a fraction of the time.
 * Nothing else may draw from that source. */
#ifndef EMULATOR_NORMALS_H
#define EMULATOR_NORMALS_H

#include "emulator/random.h"

#define NORMALS_PAIRS 32u

struct normals {
    struct random_source source;
    unsigned used;
    double values[2u * NORMALS_PAIRS];
};

void normals_init(struct normals *normals, uint64_t seed, uint64_t stream);
void normals_fill(struct normals *normals);

/* Mean 0, standard deviation 1. */
static inline double normals_next(struct normals *normals)
{
    if (normals->used == 2u * NORMALS_PAIRS) {
        normals_fill(normals);
    }
    return normals->values[normals->used++];
}

#endif
