#include "emulator/base/world_line.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Split a line into words at white space, in place. `#` starts a comment; words beyond WORLD_LINE_WORDS_MAX are
 * ignored. The words point into `text`. */
void world_line_split(struct world_line *line, char *text)
{
    char *saved;
    char *comment = strchr(text, '#');
    if (comment) {
        *comment = '\0';
    }
    line->count = 0;
    for (char *word = strtok_r(text, " \t\r\n", &saved); word && line->count < WORLD_LINE_WORDS_MAX;
         word = strtok_r(NULL, " \t\r\n", &saved)) {
        line->words[line->count++] = word;
    }
}

/* Return whether a text contains a control character other than tab and line end, such as a vertical tab: a terminal
 * could show an error message with this character as two lines. */
bool world_line_has_control_character(const char *text)
{
    for (; *text; text++) {
        if (iscntrl((unsigned char)*text) && !strchr("\t\r\n", *text)) {
            return true;
        }
    }
    return false;
}

/* Print an error message with the path and line number of the world file to stderr. Returns -1. */
int world_line_report_error(const struct world_line *line, const char *message)
{
    fprintf(stderr, "world %s, line %d: %s\n", line->path, line->number, message);
    return -1;
}

/* Read word number `index` as a finite number in [low, high]. Returns 0, or -1 after an error line on stderr. */
int world_line_read_number(const struct world_line *line, int index, double low, double high, double *value)
{
    char *end;
    if (index >= line->count) {
        return world_line_report_error(line, "a number is missing");
    }
    errno = 0;
    *value = strtod(line->words[index], &end);
    if (errno || *end || !isfinite(*value) || *value < low || *value > high) {
        fprintf(stderr, "world %s, line %d: %s: expected a number from %g to %g, found '%s'\n", line->path,
                line->number, line->words[0], low, high, line->words[index]);
        return -1;
    }
    return 0;
}

/* Read word number `index` as a whole number in [low, high]; notations such as 1e3 are accepted. Returns 0, or -1 after
 * an error line on stderr. */
int world_line_read_integer(const struct world_line *line, int index, double low, double high, long *value)
{
    double real;
    if (world_line_read_number(line, index, low, high, &real)) {
        return -1;
    }
    if (real != floor(real)) {
        return world_line_report_error(line, "expected a whole number");
    }
    *value = (long)real;
    return 0;
}

/* Read word number `index` as `size` bytes, written as exactly 2 * size hexadecimal digits. Returns 0, or -1 after an
 * error line on stderr. */
int world_line_read_hex(const struct world_line *line, int index, uint8_t *bytes, size_t size)
{
    if (index >= line->count || strlen(line->words[index]) != 2 * size) {
        return world_line_report_error(line, "a string of hexadecimal digits is missing or has another length");
    }
    for (size_t i = 0; i < size; i++) {
        const char digits[3] = {line->words[index][2 * i], line->words[index][2 * i + 1], '\0'};
        if (!isxdigit((unsigned char)digits[0]) || !isxdigit((unsigned char)digits[1])) {
            return world_line_report_error(line, "expected hexadecimal digits");
        }
        bytes[i] = (uint8_t)strtoul(digits, NULL, 16);
    }
    return 0;
}

/* Read `count` consecutive words as numbers in [low, high], starting at word number `first`. Returns 0, or -1 after an
 * error line on stderr. */
int world_line_read_numbers(const struct world_line *line, int first, int count, double low, double high,
                            double *values)
{
    for (int i = 0; i < count; i++) {
        if (world_line_read_number(line, first + i, low, high, &values[i])) {
            return -1;
        }
    }
    return 0;
}
