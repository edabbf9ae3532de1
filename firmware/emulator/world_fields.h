/* What acts on the skin, from one moment to the next, and the boards' own work between them: both shared among the world's thread_pool. */
#ifndef EMULATOR_WORLD_FIELDS_H
#define EMULATOR_WORLD_FIELDS_H

#include "emulator/world.h"

void world_boards_advance(struct world *world, vtime until);

/* The fields as they are have just been made. */
void world_fields_enter(struct world *world, vtime now);

/* The boards measure up to now with what was, then with what is new. Each returns 0, or -1 after a line on stderr: no memory, or a
 * bad stimulus. */
int world_fields_next(struct world *world, vtime now); /* the stimulus's next record */
int world_fields_step(struct world *world, vtime now); /* a step of the skin between records */

/* `values` from now on, or the live stimulus's next record if NULL. */
int world_fields_live(struct world *world, const float *values);

#endif
