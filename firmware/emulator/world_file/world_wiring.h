/* The keywords of a world file that describe the wiring between hub and boards. */
#ifndef EMULATOR_WORLD_FILE_WORLD_WIRING_H
#define EMULATOR_WORLD_FILE_WORLD_WIRING_H

#include "emulator/world_file/world_reader.h"

/* Read a line. Returns 0 after a line with one of these keywords, 1 for another keyword, or -1 after an error line on
 * stderr. */
int world_wiring_read_line(const struct world_reader *reader);

#endif
