/* A line of a world file together with the description that the line adds to. */
#ifndef EMULATOR_WORLD_FILE_WORLD_READER_H
#define EMULATOR_WORLD_FILE_WORLD_READER_H

#include "emulator/world_file/world_file.h"
#include "emulator/base/world_line.h"

struct world_reader {
    struct world_line line;
    struct world_description *world;
};

/* Return the index of the board whose address is in word `index`, or -1 after an error line on stderr. */
int world_reader_find_board(const struct world_reader *reader, int index);

#endif
