#include "emulator/base/hex_image.h"

#include <ctype.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define RECORD_MAX (1u + 2u + 1u + 255u + 1u) /* count, address, type, data, checksum */
#define LINE_SIZE_MAX (1u + 2u * RECORD_MAX + 3u)

enum record_type { DATA = 0, END = 1, SEGMENT = 2, START_SEGMENT = 3, LINEAR = 4, START_LINEAR = 5 };

/* Return the value of a hexadecimal digit, or -1 for any other character. */
static int parse_digit(char c)
{
    return isdigit((unsigned char)c) ? c - '0' : isxdigit((unsigned char)c) ? tolower((unsigned char)c) - 'a' + 10 : -1;
}

/* Convert a line of an Intel HEX file, a colon and hexadecimal digits, to bytes. Returns the number of bytes, or 0 if
 * the line is not a record. */
static size_t parse_line(const char *line, uint8_t record[RECORD_MAX])
{
    size_t size = 0;
    const size_t length = strcspn(line, "\r\n");
    if (line[0] != ':' || length % 2u != 1u || length / 2u > RECORD_MAX) {
        return 0;
    }
    for (const char *digits = line + 1; digits < line + length; digits += 2) {
        const int high = parse_digit(digits[0]), low = parse_digit(digits[1]);
        if (high < 0 || low < 0) {
            return 0;
        }
        record[size++] = (uint8_t)(high << 4 | low);
    }
    return size;
}

/* Check a record of an Intel HEX file and copy its data to `bytes` (`capacity` bytes). *base is the address offset that
 * an earlier address record has set; an address record changes it. *has_ended becomes true at the end record. Returns
 * NULL or an error message. */
static const char *apply_record(const uint8_t *record, size_t size, uint32_t *base, uint8_t *bytes, size_t capacity,
                                bool *has_ended)
{
    uint8_t sum = 0;
    for (size_t i = 0; i < size; i++) {
        sum = (uint8_t)(sum + record[i]);
    }
    if (size < 5u || size != record[0] + 5u) {
        return "expected an Intel HEX record";
    }
    if (sum) {
        return "the checksum of the record is wrong";
    }
    const uint32_t address = *base + ((uint32_t)record[1] << 8 | record[2]),
                   value = (uint32_t)record[4] << 8 | record[5];
    switch (record[3]) {
    case DATA:
        if (address >= capacity || record[0] > capacity - address) {
            return "the data of the record lie outside the flash";
        }
        memcpy(bytes + address, record + 4, record[0]);
        return NULL;
    case END:
        *has_ended = true;
        return NULL;
    case SEGMENT:
    case LINEAR:
        if (record[0] != 2u) {
            return "expected an address record of 2 bytes";
        }
        *base = record[3] == LINEAR ? value << 16 : value << 4;
        return NULL;
    case START_SEGMENT:
    case START_LINEAR:
        return NULL;
    default:
        return "the record has an unknown type";
    }
}

/* Read an Intel HEX file into a buffer of `size` bytes, filled with 0 where the file has no data. Returns NULL, or an
 * error message; *line is then the line of the error, or 0 if the file cannot be opened. */
const char *hex_image_read(const char *path, uint8_t *bytes, size_t size, int *line)
{
    char text[LINE_SIZE_MAX];
    uint8_t record[RECORD_MAX];
    uint32_t base = 0;
    bool has_ended = false;
    const char *error = NULL;
    FILE *file = fopen(path, "r");
    *line = 0;
    memset(bytes, 0, size);
    if (!file) {
        return strerror(errno);
    }
    while (!error && !has_ended && fgets(text, sizeof text, file)) {
        ++*line;
        error = apply_record(record, parse_line(text, record), &base, bytes, size, &has_ended);
    }
    fclose(file);
    return error || has_ended ? error : "the file has no end record";
}
