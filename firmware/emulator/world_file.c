#include "emulator/world_file.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WORDS_MAX 12
#define LINE_MAX_BYTES 512

struct reader {
    const char *path;
    int line;
    int count;
    char *words[WORDS_MAX];
    struct world_description *world;
};

static int complain(const struct reader *reader, const char *what)
{
    fprintf(stderr, "world %s, line %d: %s\n", reader->path, reader->line, what);
    return -1;
}

static int number(const struct reader *reader, int index, double low, double high, double *value)
{
    char *end;
    if (index >= reader->count) {
        return complain(reader, "a number is missing");
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

static int whole(const struct reader *reader, int index, double low, double high, long *value)
{
    double real;
    if (number(reader, index, low, high, &real)) {
        return -1;
    }
    if (real != floor(real)) {
        return complain(reader, "expected a whole number");
    }
    *value = (long)real;
    return 0;
}

static int hex(const struct reader *reader, int index, uint8_t *bytes, size_t size)
{
    if (index >= reader->count || strlen(reader->words[index]) != 2 * size) {
        return complain(reader, "a string of hexadecimal digits is missing or has another length");
    }
    for (size_t i = 0; i < size; i++) {
        const char digits[3] = {reader->words[index][2 * i], reader->words[index][2 * i + 1], '\0'};
        if (!isxdigit((unsigned char)digits[0]) || !isxdigit((unsigned char)digits[1])) {
            return complain(reader, "expected hexadecimal digits");
        }
        bytes[i] = (uint8_t)strtoul(digits, NULL, 16);
    }
    return 0;
}

static const struct board_description *board_with(const struct world_description *world, uint8_t address)
{
    for (size_t i = 0; i < world->board_count; i++) {
        if (world->boards[i].address == address) {
            return &world->boards[i];
        }
    }
    return NULL;
}

/* board ADDRESS KIND ROWS COLUMNS TAXELS MAP UNIQUE_ID CLOCK_PPM BOOT_MS [MAP_VERSION] */
static int read_board(const struct reader *reader)
{
    struct world_description *world = reader->world;
    long address, kind, rows, columns, taxels, version = 0;
    if (world->board_count == WORLD_BOARDS_MAX) {
        return complain(reader, "too many boards");
    }
    struct board_description *board = &world->boards[world->board_count];
    if (whole(reader, 1, TAXEL_ADDRESS_MIN, TAXEL_ADDRESS_MAX, &address) || whole(reader, 2, 0, 255, &kind) ||
        whole(reader, 3, 1, TAXEL_LINES_MAX, &rows) || whole(reader, 4, 1, TAXEL_LINES_MAX, &columns) ||
        whole(reader, 5, 1, TAXEL_TAXELS_MAX, &taxels) || hex(reader, 6, board->crossing_map, sizeof board->crossing_map) ||
        hex(reader, 7, board->unique_id, sizeof board->unique_id) || number(reader, 8, -1e5, 1e5, &board->clock_ppm) ||
        number(reader, 9, 0.1, 1e5, &board->boot_ms) || (reader->count > 10 && whole(reader, 10, 0, 255, &version))) {
        return -1;
    }
    board->address = (uint8_t)address;
    board->kind = (uint8_t)kind;
    board->rows = (uint8_t)rows;
    board->columns = (uint8_t)columns;
    board->taxel_count = (uint16_t)taxels;
    board->map_version_override = (uint8_t)version;
    world->board_count++;
    return 0;
}

static int read_scan(const struct reader *reader)
{
    struct taxel_scan_settings *scan = &reader->world->scan;
    long sub, sense, modulator, idac, settle;
    if (whole(reader, 1, 1, 65535, &sub) || whole(reader, 2, 1, 65535, &sense) || whole(reader, 3, 1, 255, &modulator) ||
        whole(reader, 4, 1, 255, &idac) || whole(reader, 5, 0, 65535, &settle)) {
        return -1;
    }
    if (sub * sense > 65535) {
        return complain(reader, "sub-conversions times sense clock divider must fit 16 bits");
    }
    scan->sub_conversions = (uint16_t)sub;
    scan->sense_clock_divider = (uint16_t)sense;
    scan->modulator_clock_divider = (uint8_t)modulator;
    scan->idac_code = (uint8_t)idac;
    scan->settle_cycles = (uint16_t)settle;
    return 0;
}

static const char *const fault_names[] = {
    [FAULT_UNPLUG] = "unplug", [FAULT_PLUG] = "plug",       [FAULT_RESTART] = "restart", [FAULT_HOLD_SDA] = "hold_sda",
    [FAULT_STRETCH] = "stretch", [FAULT_CORRUPT] = "corrupt", [FAULT_NACK] = "nack",       [FAULT_MUTE] = "mute_host",
};

/* fault TIME_S NAME ADDRESS [VALUE] */
static int read_fault(const struct reader *reader)
{
    struct world_description *world = reader->world;
    long address;
    if (world->fault_count == WORLD_FAULTS_MAX) {
        return complain(reader, "too many faults");
    }
    struct fault_description *fault = &world->faults[world->fault_count];
    fault->value = 0.0;
    if (number(reader, 1, 0.0, 1e7, &fault->time_s) || whole(reader, 3, 0, 127, &address) ||
        (reader->count > 4 && number(reader, 4, 0.0, 1e9, &fault->value))) {
        return -1;
    }
    fault->address = (uint8_t)address;
    if (world->fault_count && fault->time_s < world->faults[world->fault_count - 1].time_s) {
        return complain(reader, "faults must be in order of time");
    }
    for (size_t kind = 0; kind < sizeof fault_names / sizeof fault_names[0]; kind++) {
        if (strcmp(reader->words[2], fault_names[kind]) == 0) {
            fault->kind = (enum fault_kind)kind;
            world->fault_count++;
            return kind == FAULT_MUTE || board_with(world, fault->address) ? 0 : complain(reader, "no board has that address");
        }
    }
    return complain(reader, "unknown fault");
}

static int read_line(const struct reader *reader)
{
    struct world_description *world = reader->world;
    const char *word = reader->words[0];
    double value;
    if (strcmp(word, "board") == 0) {
        return read_board(reader);
    }
    if (strcmp(word, "scan") == 0) {
        return read_scan(reader);
    }
    if (strcmp(word, "fault") == 0) {
        return read_fault(reader);
    }
    if (strcmp(word, "seed") == 0) {
        char *end;
        if (reader->count < 2) {
            return complain(reader, "a number is missing");
        }
        errno = 0;
        world->seed = strtoull(reader->words[1], &end, 10);
        return *end || errno || !isdigit((unsigned char)reader->words[1][0])
                   ? complain(reader, "seed: expected a whole number from 0 to 2^64 - 1")
                   : 0;
    }
    const struct {
        const char *word;
        double low, high;
        double *target;
    } settings[] = {
        {"scl_hz", 1e4, 5e6, &world->scl_hz},
        {"baud", 1e3, 1e8, &world->baud},
        {"usb_latency_ms", 0.0, 255.0, &world->usb_latency_ms},
        {"hub_clock_ppm", -1e5, 1e5, &world->hub_clock_ppm},
        {"noise_counts", 0.0, 1e4, &world->noise_counts},
    };
    for (size_t i = 0; i < sizeof settings / sizeof settings[0]; i++) {
        if (strcmp(word, settings[i].word) == 0) {
            if (number(reader, 1, settings[i].low, settings[i].high, &value)) {
                return -1;
            }
            *settings[i].target = value;
            return 0;
        }
    }
    fprintf(stderr, "world %s, line %d: unknown word '%s'\n", reader->path, reader->line, word);
    return -1;
}

static void split(struct reader *reader, char *line)
{
    char *saved;
    char *comment = strchr(line, '#');
    if (comment) {
        *comment = '\0';
    }
    reader->count = 0;
    for (char *word = strtok_r(line, " \t\r\n", &saved); word && reader->count < WORDS_MAX;
         word = strtok_r(NULL, " \t\r\n", &saved)) {
        reader->words[reader->count++] = word;
    }
}

static int read_lines(struct reader *reader, FILE *file)
{
    char line[LINE_MAX_BYTES];
    while (fgets(line, sizeof line, file)) {
        reader->line++;
        if (!strchr(line, '\n') && !feof(file)) {
            return complain(reader, "the line is too long");
        }
        split(reader, line);
        if (reader->line == 1) {
            if (reader->count != 2 || strcmp(reader->words[0], "taxel-world") != 0 || strcmp(reader->words[1], "1") != 0) {
                return complain(reader, "a world begins with 'taxel-world 1'");
            }
            continue;
        }
        if (reader->count && read_line(reader)) {
            return -1;
        }
    }
    return reader->world->board_count ? 0 : complain(reader, "no board is described");
}

int world_file_read(struct world_description *world, const char *path)
{
    struct reader reader = {.path = path, .world = world};
    FILE *file = fopen(path, "r");
    memset(world, 0, sizeof *world);
    world->seed = 1;
    world->scl_hz = 400000.0;
    world->baud = 1000000.0;
    world->usb_latency_ms = 16.0;
    world->scan = (struct taxel_scan_settings){
        .sub_conversions = 160, .sense_clock_divider = 40, .modulator_clock_divider = 1, .idac_code = 16, .settle_cycles = 96};
    if (!file) {
        fprintf(stderr, "world %s: %s\n", path, strerror(errno));
        return -1;
    }
    const int result = read_lines(&reader, file);
    fclose(file);
    return result;
}
