/* Replaces the fields above the taxels of all boards over time, and advances the boards in between; both run in the
 * threads of the world's thread pool. */
#ifndef EMULATOR_WORLD_FIELDS_H
#define EMULATOR_WORLD_FIELDS_H

#include "emulator/world.h"

/* Advance every board to `until`. */
void world_advance_boards(struct world *world, vtime until);

/* Call after the skin has computed its first fields. */
void world_fields_start(struct world *world, vtime now);

/* Each function advances the boards to `now` under the present fields and then replaces the fields. Returns 0, or -1
 * after an error line on stderr: out of memory, or an invalid stimulus. */

/* The fields after the next record of the stimulus. */
int world_fields_next_record(struct world *world, vtime now);

/* The fields after a step of the skin between two records. */
int world_fields_step(struct world *world, vtime now);

/* The fields under `values`, or, if NULL, under the next record of a live stimulus. */
int world_fields_set_live(struct world *world, const float *values);

#endif
