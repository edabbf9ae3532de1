#include "emulator/world_file/world_file.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/psoc4/parts.h"
#include "emulator/world_file/world_image.h"
#include "emulator/world_file/world_reader.h"
#include "emulator/world_file/world_scene.h"
#include "emulator/world_file/world_wiring.h"

#define LINE_SIZE_MAX 512 /* with line end and terminator */

/* Return the description of the board with an I2C address, or NULL. */
static struct board_description *find_board(struct world_description *world, uint8_t address)
{
    for (size_t i = 0; i < world->board_count; i++) {
        if (world->boards[i].address == address) {
            return &world->boards[i];
        }
    }
    return NULL;
}

/* Read a line of a world file: board ADDRESS KIND ROWS COLUMNS TAXELS MAP UNIQUE_ID CLOCK_PPM BOOT_MS [MAP_VERSION].
 * MAP and UNIQUE_ID are hexadecimal. Returns 0, or -1 after an error line on stderr. */
static int read_board(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    const struct world_line *line = &reader->line;
    long address, kind, rows, columns, taxels, version = 0;
    if (world->board_count == WORLD_BOARDS_MAX) {
        return world_line_report_error(line, "more boards than the maximum of 64");
    }
    struct board_description *board = &world->boards[world->board_count];
    if (world_line_read_integer(line, 1, TAXEL_ADDRESS_MIN, TAXEL_ADDRESS_MAX, &address) ||
        world_line_read_integer(line, 2, 0, 255, &kind) ||
        world_line_read_integer(line, 3, 1, TAXEL_LINES_MAX, &rows) ||
        world_line_read_integer(line, 4, 1, TAXEL_LINES_MAX, &columns) ||
        world_line_read_integer(line, 5, 1, TAXEL_TAXELS_MAX, &taxels) ||
        world_line_read_hex(line, 6, board->crossing_map, sizeof board->crossing_map) ||
        world_line_read_hex(line, 7, board->unique_id, sizeof board->unique_id) ||
        world_line_read_number(line, 8, -1e5, 1e5, &board->clock_ppm) ||
        world_line_read_number(line, 9, 0.1, 1e5, &board->boot_ms) ||
        (line->count > 10 && world_line_read_integer(line, 10, 0, 255, &version))) {
        return -1;
    }
    board->address = (uint8_t)address;
    board->kind = (uint8_t)kind;
    board->rows = (uint8_t)rows;
    board->columns = (uint8_t)columns;
    board->taxel_count = (uint16_t)taxels;
    board->map_version_override = (uint8_t)version;
    board->bracket_offset = frame_identity;
    memcpy(board->firmware_version, (const uint8_t[3])WORLD_FIRMWARE_VERSION, sizeof board->firmware_version);
    world->board_count++;
    return 0;
}

/* Read a line of a world file: scan SUB_CONVERSIONS SENSE_CLOCK_DIVIDER MODULATOR_CLOCK_DIVIDER IDAC_CODE
 * SETTLE_CYCLES, the scan settings of all boards. The product of the first two is the full-scale count and must fit
 * into 16 bits. Returns 0, or -1 after an error line on stderr. */
static int read_scan(const struct world_reader *reader)
{
    struct taxel_scan_settings *scan = &reader->world->scan;
    const struct world_line *line = &reader->line;
    long sub, sense, modulator, idac, settle;
    if (world_line_read_integer(line, 1, 1, 65535, &sub) || world_line_read_integer(line, 2, 1, 65535, &sense) ||
        world_line_read_integer(line, 3, 1, 255, &modulator) || world_line_read_integer(line, 4, 1, 255, &idac) ||
        world_line_read_integer(line, 5, 0, 65535, &settle)) {
        return -1;
    }
    if (sub * sense > 65535) {
        return world_line_report_error(&reader->line,
                                       "sub-conversions times sense clock divider must not exceed 65535");
    }
    scan->sub_conversions = (uint16_t)sub;
    scan->sense_clock_divider = (uint16_t)sense;
    scan->modulator_clock_divider = (uint8_t)modulator;
    scan->idac_code = (uint8_t)idac;
    scan->settle_cycles = (uint16_t)settle;
    return 0;
}

/* Read a line of a world file: protocol original key=value ... The line also sets the clock rates of bus and UART and
 * the scan settings; later lines may change them. Returns 0, or -1 after an error line on stderr. */
static int read_protocol(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    world->scan = (struct taxel_scan_settings)ORIGINAL_SCAN_SETTINGS;
    return original_settings_read(&world->original, &reader->line, &world->scl_hz, &world->baud);
}

/* Read a line of a world file: fault TIME_S NAME ADDRESS [VALUE [SECOND_VALUE]], a fault that takes effect at that
 * time. Returns 0, or -1 after an error line on stderr. */
static int read_fault(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    const struct world_line *line = &reader->line;
    long address;
    if (world->fault_count == WORLD_FAULTS_MAX) {
        return world_line_report_error(line, "more faults than the maximum of 4096");
    }
    struct fault_description *fault = &world->faults[world->fault_count];
    fault->value = fault->second_value = 0.0;
    if (world_line_read_number(line, 1, 0.0, 1e7, &fault->time_s) ||
        world_line_read_integer(line, 3, 0, 127, &address) ||
        (line->count > 4 && world_line_read_number(line, 4, 0.0, 1e9, &fault->value)) ||
        (line->count > 5 && world_line_read_number(line, 5, 0.0, 1e9, &fault->second_value))) {
        return -1;
    }
    fault->address = (uint8_t)address;
    if (world->fault_count && fault->time_s < world->faults[world->fault_count - 1].time_s) {
        return world_line_report_error(line, "faults must be sorted by time");
    }
    fault->kind = fault_find_kind(line->words[2]);
    if (fault->kind == FAULT_KINDS) {
        return world_line_report_error(line, "unknown fault; firmware/emulator/README.md lists the names");
    }
    world->fault_count++;
    if (fault_get_target(fault->kind) == FAULT_TARGET_BOARD && !find_board(world, fault->address)) {
        return world_line_report_error(line, "no board has that address");
    }
    if (fault_get_target(fault->kind) == FAULT_TARGET_BRANCH) {
        if (!world->wiring.branch_of[fault->address]) {
            return world_line_report_error(line, "no branch contains a board with that address; the branch lines must "
                                                 "precede their faults");
        }
        if (!fault_has_valid_selection(fault)) {
            return world_line_report_error(line, "the value must select a line: 1 SCL, 2 SDA; branch_open also 0 the "
                                                 "whole cable, 3 the supply; branch_resistance also 0 both lines");
        }
    }
    return 0;
}

/* Return the description of the board whose I2C address is the first word after the keyword, or NULL after an error
 * line on stderr. */
static struct board_description *find_addressed_board(const struct world_reader *reader)
{
    long address;
    if (world_line_read_integer(&reader->line, 1, TAXEL_ADDRESS_MIN, TAXEL_ADDRESS_MAX, &address)) {
        return NULL;
    }
    struct board_description *board = find_board(reader->world, (uint8_t)address);
    if (!board) {
        (void)world_line_report_error(&reader->line, "no board has that address");
    }
    return board;
}

/* Read a line of a world file: firmware ADDRESS MAJOR MINOR PATCH, the firmware version that a board reports. Returns
 * 0, or -1 after an error line on stderr. */
static int read_firmware(const struct world_reader *reader)
{
    struct board_description *board = find_addressed_board(reader);
    for (int i = 0; board && i < 3; i++) {
        long number;
        if (world_line_read_integer(&reader->line, 2 + i, 0, 255, &number)) {
            return -1;
        }
        board->firmware_version[i] = (uint8_t)number;
    }
    return board ? 0 : -1;
}

/* Read a line of a world file: clock_start ADDRESS SECONDS, the reading of the clock of a board at its start. Returns
 * 0, or -1 after an error line on stderr. */
static int read_clock_start(const struct world_reader *reader)
{
    double seconds;
    struct board_description *board = find_addressed_board(reader);
    if (!board || world_line_read_number(&reader->line, 2, 0.0, 1e6, &seconds)) {
        return -1;
    }
    board->clock_start_us = seconds * 1e6;
    return 0;
}

/* Read the word after the keyword as a flag, 0 or 1. Returns 0, or -1 after an error line on stderr. */
static int read_flag(const struct world_reader *reader, bool *flag)
{
    long value;
    if (world_line_read_integer(&reader->line, 1, 0, 1, &value)) {
        return -1;
    }
    *flag = value != 0;
    return 0;
}

/* Read a line of a world file: blank ADDRESS. The board has neither application nor configuration, as after assembly.
 * Returns 0, or -1 after an error line on stderr. */
static int read_blank(const struct world_reader *reader)
{
    struct board_description *board = find_addressed_board(reader);
    if (board) {
        board->is_blank = true;
    }
    return board ? 0 : -1;
}

/* Read the word after the keyword as an unsigned 64-bit number, which a double cannot represent exactly. Returns 0, or
 * -1 after the error line `error` on stderr. */
static int read_seed(const struct world_reader *reader, const char *error, uint64_t *seed)
{
    const struct world_line *line = &reader->line;
    char *end;
    if (line->count < 2) {
        return world_line_report_error(line, "a number is missing");
    }
    errno = 0;
    *seed = strtoull(line->words[1], &end, 10);
    return *end || errno || !isdigit((unsigned char)line->words[1][0]) ? world_line_report_error(line, error) : 0;
}

/* Read one line of a world file after its header: call the reader of its keyword, or set the numeric setting of that
 * name. Returns 0, or -1 after an error line on stderr. */
static int read_line(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    const int scene = world_scene_read_line(reader);
    if (scene <= 0) {
        return scene;
    }
    const int wiring = world_wiring_read_line(reader);
    if (wiring <= 0) {
        return wiring;
    }
    const char *keyword = reader->line.words[0];
    double value;
    if (strcmp(keyword, "board") == 0) {
        return read_board(reader);
    }
    if (strcmp(keyword, "scan") == 0) {
        return read_scan(reader);
    }
    if (strcmp(keyword, "protocol") == 0) {
        return read_protocol(reader);
    }
    if (strcmp(keyword, "fault") == 0) {
        return read_fault(reader);
    }
    if (strcmp(keyword, "firmware") == 0) {
        return read_firmware(reader);
    }
    if (strcmp(keyword, "blank") == 0) {
        return read_blank(reader);
    }
    if (strcmp(keyword, "image") == 0) {
        struct board_description *board = find_addressed_board(reader);
        return board ? world_image_read(&reader->line, 2, &board->image, &board->part) : -1;
    }
    if (strcmp(keyword, "hub_image") == 0) {
        return world_image_read(&reader->line, 1, &world->hub_image, &world->hub_part);
    }
    if (strcmp(keyword, "boot_listens") == 0) {
        return read_flag(reader, &world->boot_listens);
    }
    if (strcmp(keyword, "flow_control") == 0) {
        return read_flag(reader, &world->flow_control);
    }
    if (strcmp(keyword, "clock_start") == 0) {
        return read_clock_start(reader);
    }
    if (strcmp(keyword, "effect") == 0) {
        return effects_read_line(&world->effects, &reader->line, world->boards, world->board_count);
    }
    if (strcmp(keyword, "seed") == 0) {
        return read_seed(reader, "seed: expected a whole number from 0 to 2^64 - 1", &world->seed);
    }
    if (strcmp(keyword, "parts_seed") == 0) {
        world->has_parts_seed = true;
        return read_seed(reader, "parts_seed: expected a whole number from 0 to 2^64 - 1", &world->parts_seed);
    }
    const struct {
        const char *keyword;
        double low, high;
        double *target;
    } settings[] = {
        {"scl_hz", 1e4, 5e6, &world->scl_hz},
        {"baud", 1e3, 1e8, &world->baud},
        {"usb_latency_ms", 0.0, 255.0, &world->usb_latency_ms},
        {"usb_latency_down_ms", 0.0, 255.0, &world->usb_latency_down_ms},
        {"hub_clock_ppm", -1e5, 1e5, &world->hub_clock_ppm},
        {"hub_clock_start_us", 0.0, 1e12, &world->hub_clock_start_us},
        {"hub_byte_us", 0.0, 1e3, &world->hub_byte_us},
        {"noise_counts", 0.0, 1e4, &world->noise_counts},
    };
    for (size_t i = 0; i < sizeof settings / sizeof settings[0]; i++) {
        if (strcmp(keyword, settings[i].keyword) == 0) {
            if (world_line_read_number(&reader->line, 1, settings[i].low, settings[i].high, &value)) {
                return -1;
            }
            *settings[i].target = value;
            return 0;
        }
    }
    fprintf(stderr, "world %s, line %d: unknown keyword '%s'\n", reader->line.path, reader->line.number, keyword);
    return -1;
}

/* Return whether the line is `taxel-world 1`, the first line of a world file. */
static bool is_header(const struct world_line *line)
{
    return line->count == 2 && strcmp(line->words[0], "taxel-world") == 0 && strcmp(line->words[1], "1") == 0;
}

/* Read all lines of a world file: the header `taxel-world 1`, then keyword lines, and check that the description is
 * complete. Returns 0, or -1 after an error line on stderr. */
static int read_lines(struct world_reader *reader, FILE *file)
{
    struct world_line *line = &reader->line;
    char text[LINE_SIZE_MAX];
    while (fgets(text, sizeof text, file)) {
        line->number++;
        if (!strchr(text, '\n') && !feof(file)) {
            return world_line_report_error(line, "the line is longer than 510 characters");
        }
        if (world_line_has_control_character(text)) {
            return world_line_report_error(line, "the line contains a control character; remove it");
        }
        world_line_split(line, text);
        if (line->number == 1) {
            if (!is_header(line)) {
                return world_line_report_error(line, "expected 'taxel-world 1' as the first line");
            }
            continue;
        }
        if (line->count && read_line(reader)) {
            return -1;
        }
    }
    struct world_description *world = reader->world;
    if (!world->board_count) {
        return world_line_report_error(line, "no board is described");
    }
    if (world->original.is_on && world->hub_image) {
        return world_line_report_error(line, "protocol original and hub_image exclude each other");
    }
    return original_settings_complete(&world->original, world->boards, world->board_count, line->path)
               ? -1
               : world_scene_check(reader);
}

/* Read a world file into a description, with defaults for absent settings. parts_seed, the seed of manufacturing
 * tolerances, defaults to the seed. Returns 0, or -1 after an error line on stderr. */
int world_file_read(struct world_description *world, const char *path)
{
    struct world_reader reader = {.line = {.path = path}, .world = world};
    FILE *file = fopen(path, "r");
    memset(world, 0, sizeof *world);
    world->seed = 1;
    world->wiring.hub_capacitance_pf = WIRING_HUB_CAPACITANCE_PF;
    world->layer_thickness = 0.001; /* metres */
    world->scl_hz = 400000.0;
    world->baud = 1000000.0;
    world->usb_latency_ms = 16.0;
    world->usb_latency_down_ms = 1.0;
    world->scan = (struct taxel_scan_settings){.sub_conversions = 160,
                                               .sense_clock_divider = 40,
                                               .modulator_clock_divider = 1,
                                               .idac_code = 16,
                                               .settle_cycles = 96};
    if (!file) {
        fprintf(stderr, "world %s: %s\n", path, strerror(errno));
        return -1;
    }
    const int result = read_lines(&reader, file);
    fclose(file);
    if (!world->has_parts_seed) {
        world->parts_seed = world->seed;
    }
    return result;
}

/* Free the arrays of a world description and clear it. */
void world_file_free(struct world_description *world)
{
    for (size_t i = 0; i < world->board_count; i++) {
        free(world->boards[i].taxel_poses);
        free(world->boards[i].margin_poses);
        free(world->boards[i].image);
    }
    free(world->hub_image);
    free(world->objects);
    memset(world, 0, sizeof *world);
}
