/* The words of a world file that say where taxels are and which objects there are. */
#ifndef EMULATOR_WORLD_SCENE_H
#define EMULATOR_WORLD_SCENE_H

#include "emulator/world_reader.h"

/* Returns 0 for a line of this kind, 1 for another one, -1 after a complaint. */
int world_scene_read_line(const struct world_reader *reader);

/* After the last line: is everything described that belongs together? Returns 0 or -1. */
int world_scene_check(const struct world_reader *reader);

#endif
