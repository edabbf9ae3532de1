#include "emulator/world_reader.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int world_reader_report_error(const struct world_reader *reader, const char *message)
{
    fprintf(stderr, "world %s, line %d: %s\n", reader->path, reader->line, message);
    return -1;
}

int world_reader_read_number(const struct world_reader *reader, int index, double low, double high, double *value)
{
    char *end;
    if (index >= reader->count) {
        return world_reader_report_error(reader, "a number is missing");
    }
    errno = 0;
    *value = strtod(reader->words[index], &end);
    if (errno || *end || !isfinite(*value) || *value < low || *value > high) {
        fprintf(stderr, "world %s, line %d: %s: expected a number from %g to %g, found '%s'\n", reader->path, reader->line,
                reader->words[0], low, high, reader->words[index]);
        return -1;
    }
    return 0;
}

int world_reader_read_integer(const struct world_reader *reader, int index, double low, double high, long *value)
{
    double real;
    if (world_reader_read_number(reader, index, low, high, &real)) {
        return -1;
    }
    if (real != floor(real)) {
        return world_reader_report_error(reader, "expected a whole number");
    }
    *value = (long)real;
    return 0;
}

int world_reader_read_hex(const struct world_reader *reader, int index, uint8_t *bytes, size_t size)
{
    if (index >= reader->count || strlen(reader->words[index]) != 2 * size) {
        return world_reader_report_error(reader, "a string of hexadecimal digits is missing or has another length");
    }
    for (size_t i = 0; i < size; i++) {
        const char digits[3] = {reader->words[index][2 * i], reader->words[index][2 * i + 1], '\0'};
        if (!isxdigit((unsigned char)digits[0]) || !isxdigit((unsigned char)digits[1])) {
            return world_reader_report_error(reader, "expected hexadecimal digits");
        }
        bytes[i] = (uint8_t)strtoul(digits, NULL, 16);
    }
    return 0;
}

int world_reader_read_numbers(const struct world_reader *reader, int first, int count, double low, double high, double *values)
{
    for (int i = 0; i < count; i++) {
        if (world_reader_read_number(reader, first + i, low, high, &values[i])) {
            return -1;
        }
    }
    return 0;
}

int world_reader_find_board(const struct world_reader *reader, int index)
{
    long address;
    if (world_reader_read_integer(reader, index, 0, 127, &address)) {
        return -1;
    }
    for (size_t i = 0; i < reader->world->board_count; i++) {
        if (reader->world->boards[i].address == address) {
            return (int)i;
        }
    }
    return world_reader_report_error(reader, "no board has that address");
}
