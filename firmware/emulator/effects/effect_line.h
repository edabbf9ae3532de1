/* Parser of the world-file line `effect NAME FORM key=value ...`, which requests one deviation from the ideal sensor.
 *
 * The module of the effect reads the keys that it supports; effect_line_check_keys() rejects the others. Each function
 * that returns an int returns 0, unless stated otherwise, or -1 after one line on stderr that names file, line, effect
 * and key. */
#ifndef EMULATOR_EFFECTS_EFFECT_LINE_H
#define EMULATOR_EFFECTS_EFFECT_LINE_H

#include <stdbool.h>
#include <stddef.h>

#include "emulator/geometry/board_description.h"
#include "emulator/base/world_line.h"

struct effect_line {
    const struct world_line *source;
    const struct board_description *boards; /* [board_count] described so far */
    size_t board_count;
    const char *name, *form;
    bool used[WORLD_LINE_WORDS_MAX];
};

int effect_line_open(struct effect_line *line, const struct world_line *source, const struct board_description *boards,
                     size_t board_count);
int effect_line_report_error(const struct effect_line *line, const char *message);

/* Return the index of the line's form in `forms` (terminated by NULL), or -1 after an error that lists the forms. */
int effect_line_form_index(struct effect_line *line, const char *const *forms);

bool effect_line_has_key(const struct effect_line *line, const char *key);

/* Read the number after `key=`, which is required and must lie in [low, high]. */
int effect_line_number(struct effect_line *line, const char *key, double low, double high, double *value);
/* Read a number as effect_line_number() does. If the key is absent, *value is set to `fallback`. */
int effect_line_optional(struct effect_line *line, const char *key, double low, double high, double fallback,
                         double *value);

/* Read an integer as effect_line_number() reads a number. */
int effect_line_integer(struct effect_line *line, const char *key, long low, long high, long *value);

/* Read the index, in the world's description, of the board with the address after `board=`. */
int effect_line_board(struct effect_line *line, size_t *index);

/* Report an error if the line contains a key that the module has not read. */
int effect_line_check_keys(const struct effect_line *line);

#endif
