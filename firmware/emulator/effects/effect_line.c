#include "emulator/effects/effect_line.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_KEY 3

/* Print an error message with file, line number and name of the effect to stderr. Returns -1. */
int effect_line_report_error(const struct effect_line *line, const char *message)
{
    fprintf(stderr, "world %s, line %d: effect %s: %s\n", line->source->path, line->source->number, line->name,
            message);
    return -1;
}

/* Start to parse the words `effect NAME FORM key=value ...` of a world-file line. `boards`: the boards described in
 * earlier lines, to which `board=` can refer. Returns 0, or -1 after an error line on stderr. */
int effect_line_open(struct effect_line *line, const struct world_line *source, const struct board_description *boards,
                     size_t board_count)
{
    memset(line, 0, sizeof *line);
    line->source = source;
    line->boards = boards;
    line->board_count = board_count;
    if (source->count < FIRST_KEY) {
        return world_line_report_error(source, "expected 'effect NAME FORM key=value ...', found no form");
    }
    line->name = source->words[1];
    line->form = source->words[2];
    return 0;
}

/* Return the index of the line's FORM in the NULL-terminated list `forms`, or -1 after an error line on stderr that
 * lists the valid forms. */
int effect_line_form_index(struct effect_line *line, const char *const *forms)
{
    char known_forms[160] = "";
    for (int i = 0; forms[i]; i++) {
        if (strcmp(line->form, forms[i]) == 0) {
            return i;
        }
        snprintf(known_forms + strlen(known_forms), sizeof known_forms - strlen(known_forms), "%s%s", i ? ", " : "",
                 forms[i]);
    }
    fprintf(stderr, "world %s, line %d: effect %s: expected one of the forms %s, found '%s'\n", line->source->path,
            line->source->number, line->name, known_forms, line->form);
    return -1;
}

/* Return the index of the word `key=...` in the line, or 0 if the key is absent. */
static int find_key(const struct effect_line *line, const char *key)
{
    const size_t length = strlen(key);
    for (int i = FIRST_KEY; i < line->source->count; i++) {
        if (strncmp(line->source->words[i], key, length) == 0 && line->source->words[i][length] == '=') {
            return i;
        }
    }
    return 0;
}

/* Return whether the effect line contains `key`. */
bool effect_line_has_key(const struct effect_line *line, const char *key)
{
    return find_key(line, key) != 0;
}

/* Read the number of the required word `key=number`, which must lie in [low, high], and mark the word as used. Returns
 * 0, or -1 after an error line on stderr. */
int effect_line_number(struct effect_line *line, const char *key, double low, double high, double *value)
{
    const int index = find_key(line, key);
    char *end = NULL;
    if (index) {
        const char *text = line->source->words[index] + strlen(key) + 1;
        line->used[index] = true;
        errno = 0;
        *value = strtod(text, &end);
        if (end != text && !*end && !errno && isfinite(*value) && *value >= low && *value <= high) {
            return 0;
        }
    }
    fprintf(stderr, "world %s, line %d: effect %s: expected %s= with a number from %g to %g, found %s\n",
            line->source->path, line->source->number, line->name, key, low, high,
            index ? line->source->words[index] : "nothing");
    return -1;
}

/* Read the number of the optional word `key=number`, which must lie in [low, high]; *value becomes `fallback` if the
 * key is absent. Returns 0, or -1 after an error line on stderr. */
int effect_line_optional(struct effect_line *line, const char *key, double low, double high, double fallback,
                         double *value)
{
    *value = fallback;
    return find_key(line, key) ? effect_line_number(line, key, low, high, value) : 0;
}

/* Read a required whole number after `key=` in [low, high]. Returns 0, or -1 after an error line on stderr. */
int effect_line_integer(struct effect_line *line, const char *key, long low, long high, long *value)
{
    double real;
    if (effect_line_number(line, key, (double)low, (double)high, &real)) {
        return -1;
    }
    *value = (long)real;
    return real == floor(real) ? 0 : effect_line_report_error(line, "expected a whole number");
}

/* Read the index of the board whose I2C address follows the required key `board=` (decimal, or hexadecimal with 0x).
 * Returns 0, or -1 after an error line on stderr if the world has no board with this address. */
int effect_line_board(struct effect_line *line, size_t *index)
{
    const int word = find_key(line, "board");
    char *end = NULL;
    const long address = word ? strtol(line->source->words[word] + strlen("board="), &end, 0) : -1;
    for (size_t i = 0; word && !*end && i < line->board_count; i++) {
        if (line->boards[i].address == address) {
            line->used[word] = true;
            *index = i;
            return 0;
        }
    }
    return effect_line_report_error(line, "expected board= with the address of one of this world's boards");
}

/* Reject an effect line with a word that no read function has used, so that a misspelt key is not silently ignored.
 * Returns 0, or -1 after an error line on stderr. */
int effect_line_check_keys(const struct effect_line *line)
{
    for (int i = FIRST_KEY; i < line->source->count; i++) {
        if (!line->used[i]) {
            fprintf(stderr, "world %s, line %d: effect %s %s: unknown or misspelt '%s'\n", line->source->path,
                    line->source->number, line->name, line->form, line->source->words[i]);
            return -1;
        }
    }
    return 0;
}
