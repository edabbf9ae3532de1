/* Load of one board (pressures and gaps of its cells, forces on its taxels) at a record of the stimulus. */
#ifndef EMULATOR_SKIN_BOARD_LOAD_H
#define EMULATOR_SKIN_BOARD_LOAD_H

#include "emulator/skin/skin_board.h"
#include "emulator/world_file/world_file.h"

/* Compute the load from the values of a scene record: number and pose of the object, poses of the brackets. last: load
 * of the previous record, which is copied if no pose has changed, as during the hold phase of a grasp. */
void board_load_from_scene(struct skin_board *board, const struct world_description *description, size_t index,
                           const float *values, const struct field_load *last, struct field_load *load);

/* Compute the load from forces [taxels of the board], newtons. */
void board_load_from_forces(struct skin_board *board, const float *force, struct field_load *load);

#endif
