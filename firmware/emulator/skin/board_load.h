/* Load of one board at a record of the stimulus. */
#ifndef EMULATOR_SKIN_BOARD_LOAD_H
#define EMULATOR_SKIN_BOARD_LOAD_H

#include "emulator/skin/skin_board.h"
#include "emulator/world_file/world_file.h"

/* Compute the load from the values of a scene. `last`: load of the previous record, which is copied if no pose changed,
 * as while a grasp holds. */
void board_load_from_scene(struct skin_board *board, const struct world_description *description, size_t index,
                           const float *values, const struct field_load *last, struct field_load *load);

/* Compute the load from forces [taxels of the board], newtons. */
void board_load_from_forces(struct skin_board *board, const float *force, struct field_load *load);

#endif
