#include "emulator/original/original_settings.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_KEY 2
#define TAXELS_OF_THE_BOARD 0 /* in the list, until original_settings_complete() has looked the number up */

static const struct {
    const char *name;
    enum original_fault fault;
} fault_names[] = {
    {"truncated_taxel", ORIGINAL_TRUNCATED_TAXEL}, {"wrong_buffer", ORIGINAL_WRONG_BUFFER},
    {"receive_buffer", ORIGINAL_RECEIVE_BUFFER},   {"wait_for_ever", ORIGINAL_WAIT_FOR_EVER},
    {"stale_timestamp", ORIGINAL_STALE_TIMESTAMP},
};

/* Print an error line that names the expected and the found text of a key. Returns -1. */
static int report_value(const struct world_line *line, const char *key, const char *expected, const char *found)
{
    fprintf(stderr, "world %s, line %d: protocol original: %s: expected %s, found '%s'\n", line->path, line->number,
            key, expected, found);
    return -1;
}

/* Convert the text after `key=` to a number in [low, high]. Returns 0, or -1 after an error line on stderr. */
static int read_number(const struct world_line *line, const char *key, const char *text, double low, double high,
                       double *value)
{
    char *end, expected[64];
    errno = 0;
    *value = strtod(text, &end);
    if (end != text && !*end && !errno && isfinite(*value) && *value >= low && *value <= high) {
        return 0;
    }
    snprintf(expected, sizeof expected, "a number from %g to %g", low, high);
    return report_value(line, key, expected, text);
}

/* Return the index of a text in a list of `count` names, or -1 after an error line on stderr that states `expected`. */
static int read_choice(const struct world_line *line, const char *key, const char *text, const char *const *names,
                       int count, const char *expected)
{
    for (int i = 0; i < count; i++) {
        if (strcmp(text, names[i]) == 0) {
            return i;
        }
    }
    return report_value(line, key, expected, text);
}

/* Read the fault names after `faults=`, separated by commas. Returns 0, or -1 after an error line on stderr. */
static int read_faults(struct original_settings *settings, const struct world_line *line, char *text)
{
    char *saved;
    settings->faults = 0;
    for (char *name = strtok_r(text, ",", &saved); name; name = strtok_r(NULL, ",", &saved)) {
        size_t i = 0;
        while (i < sizeof fault_names / sizeof fault_names[0] && strcmp(name, fault_names[i].name) != 0) {
            i++;
        }
        if (i == sizeof fault_names / sizeof fault_names[0]) {
            return report_value(line, "faults",
                                "truncated_taxel, wrong_buffer, receive_buffer, wait_for_ever or stale_timestamp",
                                name);
        }
        settings->faults |= (unsigned)fault_names[i].fault;
    }
    return 0;
}

/* Read one entry ADDRESS[:TAXELS] of the list of boards. Returns 0, or -1 after an error line on stderr. */
static int read_entry(struct original_settings *settings, const struct world_line *line, const char *text)
{
    char *end;
    const long address = strtol(text, &end, 0);
    const bool has_taxels = *end == ':';
    const char *digits = has_taxels ? end + 1 : "1";
    char *taxels_end;
    const long taxels = strtol(digits, &taxels_end, 10);
    const bool is_valid = end != text && (has_taxels || !*end) && address >= TAXEL_ADDRESS_MIN &&
                          address <= TAXEL_ADDRESS_MAX && taxels_end != digits && !*taxels_end && taxels >= 1 &&
                          taxels <= (long)ORIGINAL_WORDS_MAX;
    if (!is_valid || settings->list_size == WORLD_BOARDS_MAX) {
        return report_value(line, "order",
                            is_valid ? "at most 64 boards" : "ADDRESS or ADDRESS:TAXELS with 1 to 123 taxels", text);
    }
    for (size_t i = 0; i < settings->list_size; i++) {
        if (settings->list[i].address == address) {
            return report_value(line, "order", "each address once", text);
        }
    }
    settings->list[settings->list_size++] = (struct original_board_entry){
        .address = (uint8_t)address, .taxels = has_taxels ? (uint8_t)taxels : TAXELS_OF_THE_BOARD};
    return 0;
}

/* Read the addresses after `accelerations=`, separated by commas. Returns 0, or -1 after an error line on stderr. */
static int read_accelerations(struct original_settings *settings, const struct world_line *line, char *text)
{
    char *saved;
    for (char *word = strtok_r(text, ",", &saved); word; word = strtok_r(NULL, ",", &saved)) {
        char *end;
        const long address = strtol(word, &end, 0);
        if (end == word || *end || address < (long)TAXEL_ADDRESS_MIN || address > (long)TAXEL_ADDRESS_MAX) {
            return report_value(line, "accelerations", "addresses of boards", word);
        }
        settings->has_accelerations[address] = true;
    }
    return 0;
}

/* Read the list of polled boards after `order=`, separated by commas. Returns 0, or -1 after an error line on
 * stderr. */
static int read_order(struct original_settings *settings, const struct world_line *line, char *text)
{
    char *saved;
    settings->list_size = 0;
    for (char *entry = strtok_r(text, ",", &saved); entry; entry = strtok_r(NULL, ",", &saved)) {
        if (read_entry(settings, line, entry)) {
            return -1;
        }
    }
    return settings->list_size ? 0 : report_value(line, "order", "addresses", "");
}

/* Set the settings to their defaults: those of a line `protocol original` without keys. */
void original_settings_set_defaults(struct original_settings *settings)
{
    *settings = (struct original_settings){.is_on = true,
                                           .delay_ms = ORIGINAL_DELAY_MS,
                                           .is_paced = true,
                                           .ring_size = ORIGINAL_RING_SIZE,
                                           .copy_us = ORIGINAL_COPY_US};
}

/* Read the value of a key that is a choice or a list. Returns 0, -1 after an error line on stderr, or 1 if the key is
 * not one of these. */
static int read_text_key(struct original_settings *settings, const struct world_line *line, const char *key, char *text)
{
    static const char *const variants[] = {"main", "branch"};
    static const char *const messages[] = {"timestamp", "no_timestamp", "high_byte_first"};
    int choice = 0;
    if (strcmp(key, "order") == 0) {
        return read_order(settings, line, text);
    }
    if (strcmp(key, "accelerations") == 0) {
        return read_accelerations(settings, line, text);
    }
    if (strcmp(key, "faults") == 0) {
        return read_faults(settings, line, text);
    }
    if (strcmp(key, "variant") == 0) {
        choice = read_choice(line, key, text, variants, 2, "main or branch");
        settings->variant = choice < 0 ? ORIGINAL_MAIN : (enum original_variant)choice;
        return choice < 0 ? -1 : 0;
    }
    if (strcmp(key, "message") == 0) {
        choice = read_choice(line, key, text, messages, 3, "timestamp, no_timestamp or high_byte_first");
        settings->message = choice < 0 ? ORIGINAL_WITH_TIMESTAMP : (enum original_message)choice;
        return choice < 0 ? -1 : 0;
    }
    return 1;
}

/* Read one word KEY=VALUE of the line; KEY is terminated in place. Returns 0, or -1 after an error line on stderr. */
static int read_key(struct original_settings *settings, const struct world_line *line, char *word, double *scl_hz,
                    double *baud)
{
    char *text = strchr(word, '=');
    if (!text) {
        return report_value(line, "options", "key=value", word);
    }
    *text++ = '\0';
    const int result = read_text_key(settings, line, word, text);
    if (result <= 0) {
        return result;
    }
    double pacing = settings->is_paced, ring_size = settings->ring_size;
    const struct {
        const char *key;
        double low, high;
        double *target;
    } numbers[] = {
        {"scl_hz", 1e4, 5e6, scl_hz},
        {"baud", 1e3, 1e8, baud},
        {"delay_ms", 0.0, 1e5, &settings->delay_ms},
        {"copy_us", 0.0, 1e4, &settings->copy_us},
        {"pacing", 0.0, 1.0, &pacing},
        {"ring", 16.0, ORIGINAL_RING_SIZE_MAX, &ring_size},
    };
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        if (strcmp(word, numbers[i].key) == 0) {
            if (read_number(line, word, text, numbers[i].low, numbers[i].high, numbers[i].target)) {
                return -1;
            }
            if (pacing != floor(pacing) || ring_size != floor(ring_size)) {
                return report_value(line, word, "a whole number", text);
            }
            settings->is_paced = pacing != 0.0;
            settings->ring_size = (uint16_t)ring_size;
            return 0;
        }
    }
    return report_value(line, "options",
                        "order, accelerations, faults, variant, message, scl_hz, baud, delay_ms, copy_us, pacing or "
                        "ring before the '='",
                        word);
}

/* Read the line `protocol original key=value ...`. Returns 0, or -1 after an error line on stderr. */
int original_settings_read(struct original_settings *settings, const struct world_line *line, double *scl_hz,
                           double *baud)
{
    if (line->count < FIRST_KEY || strcmp(line->words[1], "original") != 0) {
        return world_line_report_error(line, "expected 'protocol original key=value ...'");
    }
    original_settings_set_defaults(settings);
    *scl_hz = ORIGINAL_SCL_HZ;
    *baud = ORIGINAL_BAUD;
    for (int i = FIRST_KEY; i < line->count; i++) {
        if (read_key(settings, line, line->words[i], scl_hz, baud)) {
            return -1;
        }
    }
    return 0;
}

/* Return the number of taxels of the board with this address, or 0 if no board has the address. */
static unsigned find_taxel_count(const struct board_description *boards, size_t board_count, uint8_t address)
{
    for (size_t i = 0; i < board_count; i++) {
        if (boards[i].address == address) {
            return boards[i].taxel_count;
        }
    }
    return 0;
}

/* Return the number of words that the board sends: its raw counts, and the accelerations of some fingertips. */
unsigned original_settings_count_words(const struct original_settings *settings, uint8_t address, unsigned taxels)
{
    return taxels + (settings->has_accelerations[address] ? TAXEL_ORIGINAL_ACCELERATIONS : 0u);
}

/* Check that the boards suit the protocol, and complete the list of polled boards: all boards without the key `order`,
 * and the taxel counts that the list does not state. Returns 0, or -1 after an error line on stderr. */
int original_settings_complete(struct original_settings *settings, const struct board_description *boards,
                               size_t board_count, const char *path)
{
    if (!settings->is_on) {
        return 0;
    }
    for (size_t i = 0; i < board_count; i++) {
        if (boards[i].image || boards[i].is_blank) {
            fprintf(stderr, "world %s: protocol original: board 0x%02X: expected no image and no blank board\n", path,
                    boards[i].address);
            return -1;
        }
        const unsigned words = original_settings_count_words(settings, boards[i].address, boards[i].taxel_count);
        if (words > ORIGINAL_WORDS_MAX) {
            fprintf(
                stderr,
                "world %s: protocol original: board 0x%02X: expected at most 123 taxels and accelerations, found %u\n",
                path, boards[i].address, words);
            return -1;
        }
    }
    for (size_t i = 0; !settings->list_size && i < board_count; i++) {
        settings->list[i].address = boards[i].address;
    }
    settings->list_size = settings->list_size ? settings->list_size : board_count;
    for (size_t i = 0; i < settings->list_size; i++) {
        struct original_board_entry *entry = &settings->list[i];
        if (entry->taxels == TAXELS_OF_THE_BOARD) {
            entry->taxels = (uint8_t)find_taxel_count(boards, board_count, entry->address);
        }
        if (entry->taxels == TAXELS_OF_THE_BOARD) {
            fprintf(
                stderr,
                "world %s: protocol original: order: no board has the address 0x%02X; expected 0x%02X:TAXELS for an "
                "absent board\n",
                path, entry->address, entry->address);
            return -1;
        }
        entry->words = (uint8_t)original_settings_count_words(settings, entry->address, entry->taxels);
        if (entry->words > ORIGINAL_WORDS_MAX) {
            fprintf(
                stderr,
                "world %s: protocol original: order: 0x%02X: expected at most 123 taxels and accelerations, found %u\n",
                path, entry->address, entry->words);
            return -1;
        }
    }
    return 0;
}
