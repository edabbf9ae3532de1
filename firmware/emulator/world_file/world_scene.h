/* The keywords of a world file that describe the poses of taxels, and the objects. */
#ifndef EMULATOR_WORLD_FILE_WORLD_SCENE_H
#define EMULATOR_WORLD_FILE_WORLD_SCENE_H

#include "emulator/world_file/world_reader.h"

/* Read a line. Returns 0 after a line with one of these keywords, 1 for another keyword, or -1 after an error line on
 * stderr. */
int world_scene_read_line(const struct world_reader *reader);

/* Check that the descriptions are complete, after the last line. Returns 0, or -1 after an error line on stderr. */
int world_scene_check(const struct world_reader *reader);

#endif
