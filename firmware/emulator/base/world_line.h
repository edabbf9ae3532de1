/* One line of a world file as words, and functions that convert words to values. Each function reports an error as one
 * line on stderr that names the file, the line and the error. */
#ifndef EMULATOR_BASE_WORLD_LINE_H
#define EMULATOR_BASE_WORLD_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define WORLD_LINE_WORDS_MAX 24

struct world_line {
    const char *path;
    int number; /* of the line in the file, from 1 */
    int count;
    char *words[WORLD_LINE_WORDS_MAX];
};

/* Split `text` into words in place. A `#` starts a comment; words beyond WORLD_LINE_WORDS_MAX are ignored. */
void world_line_split(struct world_line *line, char *text);
bool world_line_has_control_character(const char *text);

/* All functions below return 0, or -1 after an error line on stderr; world_line_report_error() always returns -1.
 * index: number of the word in the line. Numbers must lie in [low, high]. */
int world_line_report_error(const struct world_line *line, const char *message);
int world_line_read_number(const struct world_line *line, int index, double low, double high, double *value);
int world_line_read_integer(const struct world_line *line, int index, double low, double high, long *value);

/* Read `size` bytes, which are written as twice as many hexadecimal digits. */
int world_line_read_hex(const struct world_line *line, int index, uint8_t *bytes, size_t size);

/* Read the words `first` to `first + count - 1` as numbers. */
int world_line_read_numbers(const struct world_line *line, int first, int count, double low, double high,
                            double *values);

#endif
