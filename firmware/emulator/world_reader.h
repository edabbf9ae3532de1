/* One line of a world file as words, and the checks that turn words into values. Each refuses with one line on stderr that
 * names the file, the line and what is wrong. */
#ifndef EMULATOR_WORLD_READER_H
#define EMULATOR_WORLD_READER_H

#include "emulator/world_file.h"

#define WORLD_READER_WORDS_MAX 24

struct world_reader {
    const char *path;
    int line;
    int count;
    char *words[WORLD_READER_WORDS_MAX];
    struct world_description *world;
};

/* All return 0, or -1 after that line; world_reader_complain() always -1. `index` is a word's place in the line. */
int world_reader_complain(const struct world_reader *reader, const char *what);
int world_reader_number(const struct world_reader *reader, int index, double low, double high, double *value);
int world_reader_whole(const struct world_reader *reader, int index, double low, double high, long *value);
int world_reader_hex(const struct world_reader *reader, int index, uint8_t *bytes, size_t size);

/* Numbers `first` to `first + count - 1` of the line. */
int world_reader_numbers(const struct world_reader *reader, int first, int count, double low, double high, double *values);

/* Which board has the address in word `index`: its place in the description, or -1. */
int world_reader_board(const struct world_reader *reader, int index);

#endif
