/* One line of a world file as words, and functions that convert words to values. Each function reports an error as one line on stderr
 * that names the file, the line and the error. */
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

/* All return 0, or -1 after an error line; world_reader_report_error() always returns -1. `index`: of the word in the line. */
int world_reader_report_error(const struct world_reader *reader, const char *message);
int world_reader_read_number(const struct world_reader *reader, int index, double low, double high, double *value);
int world_reader_read_integer(const struct world_reader *reader, int index, double low, double high, long *value);
int world_reader_read_hex(const struct world_reader *reader, int index, uint8_t *bytes, size_t size);

/* Words `first` to `first + count - 1`. */
int world_reader_read_numbers(const struct world_reader *reader, int first, int count, double low, double high, double *values);

/* The index of the board whose address is in word `index`, or -1 after an error line. */
int world_reader_find_board(const struct world_reader *reader, int index);

#endif
