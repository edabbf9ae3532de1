/* Planned power cuts (flash.h) of a world's boards and its hub: each strikes a chosen write to flash at a chosen point of it. */
#ifndef EMULATOR_POWER_CUTS_H
#define EMULATOR_POWER_CUTS_H

#include "emulator/world.h"

/* When the next cut, or the end of one, is due. */
vtime power_cuts_next(const struct world *world);
/* What is due at `now`. */
void power_cuts_make(struct world *world, vtime now);

#endif
