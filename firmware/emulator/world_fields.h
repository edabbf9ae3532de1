/* Replace the fields above the taxels of all boards over time, and advance the boards in between; both run in the
 * threads of the world's thread pool. */
#ifndef EMULATOR_WORLD_FIELDS_H
#define EMULATOR_WORLD_FIELDS_H

#include "emulator/world.h"

/* Advance every board to `until`. */
void world_advance_boards(struct world *world, vtime until);

/* Begin the first interval of the fields, after the skin has computed its first fields. */
void world_fields_start(struct world *world, vtime now);

/* Each of the following functions advances the boards to `now` under the present fields and then replaces the fields.
 * Each returns 0, or -1 after an error line on stderr: out of memory, or an invalid stimulus. */

/* Replace the fields at a record of the stimulus: the next interval ends at the following record. */
int world_fields_next_record(struct world *world, vtime now);

/* Replace the fields at the end of a step of the skin between two records. */
int world_fields_step(struct world *world, vtime now);

/* Replace the fields by those under `values`, or, if `values` is NULL, under the next record of a live stimulus. */
int world_fields_set_live(struct world *world, const float *values);

#endif
