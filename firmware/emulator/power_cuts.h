/* Planned power cuts (flash.h) of the boards and of the hub of a world. */
#ifndef EMULATOR_POWER_CUTS_H
#define EMULATOR_POWER_CUTS_H

#include "emulator/world.h"

/* Return the time of the next cut, or of the next return of power. */
vtime power_cuts_next_time(const struct world *world);

/* Switch off and on everything that is due at `now`. */
void power_cuts_run(struct world *world, vtime now);

#endif
