#include "emulator/hex_image.h"

#include <ctype.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define RECORD_MAX (1u + 2u + 1u + 255u + 1u) /* count, address, type, data, checksum */
#define LINE_MAX_BYTES (1u + 2u * RECORD_MAX + 3u)

enum { DATA = 0, END = 1, SEGMENT = 2, START_SEGMENT = 3, LINEAR = 4, START_LINEAR = 5 };

static int digit(char c)
{
    return isdigit((unsigned char)c) ? c - '0' : isxdigit((unsigned char)c) ? tolower((unsigned char)c) - 'a' + 10 : -1;
}

/* The bytes of a line after its colon; 0: not such a line. */
static size_t unpack(const char *line, uint8_t record[RECORD_MAX])
{
    size_t size = 0;
    const size_t length = strcspn(line, "\r\n");
    if (line[0] != ':' || length % 2u != 1u || length / 2u > RECORD_MAX) {
        return 0;
    }
    for (const char *at = line + 1; at < line + length; at += 2) {
        const int high = digit(at[0]), low = digit(at[1]);
        if (high < 0 || low < 0) {
            return 0;
        }
        record[size++] = (uint8_t)(high << 4 | low);
    }
    return size;
}

static const char *take(const uint8_t *record, size_t size, uint32_t *base, uint8_t *bytes, size_t room, bool *ended)
{
    uint8_t sum = 0;
    for (size_t i = 0; i < size; i++) {
        sum = (uint8_t)(sum + record[i]);
    }
    if (size < 5u || size != record[0] + 5u) {
        return "expected a record of Intel HEX";
    }
    if (sum) {
        return "the record's checksum is wrong";
    }
    const uint32_t address = *base + ((uint32_t)record[1] << 8 | record[2]), value = (uint32_t)record[4] << 8 | record[5];
    switch (record[3]) {
    case DATA:
        if (address >= room || record[0] > room - address) {
            return "its data lie outside the flash";
        }
        memcpy(bytes + address, record + 4, record[0]);
        return NULL;
    case END:
        *ended = true;
        return NULL;
    case SEGMENT:
    case LINEAR:
        if (record[0] != 2u) {
            return "expected a record of Intel HEX";
        }
        *base = record[3] == LINEAR ? value << 16 : value << 4;
        return NULL;
    case START_SEGMENT:
    case START_LINEAR:
        return NULL;
    default:
        return "a record of unknown type";
    }
}

const char *hex_image_read(const char *path, uint8_t *bytes, size_t size, int *line)
{
    char text[LINE_MAX_BYTES];
    uint8_t record[RECORD_MAX];
    uint32_t base = 0;
    bool ended = false;
    const char *complaint = NULL;
    FILE *file = fopen(path, "r");
    *line = 0;
    memset(bytes, 0, size);
    if (!file) {
        return strerror(errno);
    }
    while (!complaint && !ended && fgets(text, sizeof text, file)) {
        ++*line;
        complaint = take(record, unpack(text, record), &base, bytes, size, &ended);
    }
    fclose(file);
    return complaint || ended ? complaint : "the file has no end record";
}
