/* A record of the stimulus, as the load of one board. */
#ifndef EMULATOR_SKIN_PRESS_H
#define EMULATOR_SKIN_PRESS_H

#include "emulator/skin/skin.h"

/* From a scene's values. `last`: the load of the record before, which is taken again if nothing has moved, as while a grasp
 * holds. */
void press_scene(struct skin_board *board, const struct world_description *description, size_t index, const float *values,
                 const struct field_load *last, struct field_load *load);

/* From forces [taxels of the board], newtons. */
void press_forces(struct skin_board *board, const float *force, struct field_load *load);

#endif
