/* `effect NAME FORM key=value ...`: one departure from the ideal sensor, as a line of the world file.
 *
 * A module asks for the keys that it knows; what nobody asked for is refused. Each function returns 0, or -1 after one line
 * on stderr that names file, line, effect and key. */
#ifndef EMULATOR_EFFECTS_EFFECT_LINE_H
#define EMULATOR_EFFECTS_EFFECT_LINE_H

#include <stdbool.h>

#include "emulator/world_reader.h"

struct effect_line {
    const struct world_reader *reader;
    const char *name, *form;
    bool used[WORLD_READER_WORDS_MAX];
};

int effect_line_open(struct effect_line *line, const struct world_reader *reader);
int effect_line_complain(const struct effect_line *line, const char *what);

/* Which of `forms` (ended by NULL) the line names: its index from 0, or -1 after a complaint that lists them. */
int effect_line_form(struct effect_line *line, const char *const *forms);

bool effect_line_has(const struct effect_line *line, const char *key);

/* The number after `key=`, which must be there. */
int effect_line_number(struct effect_line *line, const char *key, double low, double high, double *value);
/* The same, or `fallback` without that key. */
int effect_line_optional(struct effect_line *line, const char *key, double low, double high, double fallback, double *value);
int effect_line_whole(struct effect_line *line, const char *key, long low, long high, long *value);

/* The board with the address after `board=`: its index in the description. */
int effect_line_board(struct effect_line *line, size_t *index);

/* After the module: a key that nobody asked for is refused. */
int effect_line_close(const struct effect_line *line);

#endif
