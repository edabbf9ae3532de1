#include "emulator/world_file/world_wiring.h"

#include <ctype.h>
#include <string.h>

#define OHM_MAX 1e6
#define PICOFARAD_MAX 1e5
#define PULLUP_OHM_MIN 100.0 /* a smaller pull-up resistor would exceed the current of every I2C driver */

/* Read a pull-up resistance in ohms (0: no resistor) from word number `index`. Returns 0, or -1 after an error line on
 * stderr. */
static int read_pullup(const struct world_line *line, int index, double *ohm)
{
    if (world_line_read_number(line, index, 0.0, OHM_MAX, ohm)) {
        return -1;
    }
    if (*ohm > 0.0 && *ohm < PULLUP_OHM_MIN) {
        return world_line_report_error(line, "a pull-up must be 0 (none) or at least 100 ohms");
    }
    return 0;
}

/* Read a line of a world file: wiring passive|buffered HUB_PULLUP_OHM HUB_CAPACITANCE_PF. Returns 0, or -1 after an
 * error line on stderr. */
static int read_wiring(const struct world_reader *reader)
{
    struct wiring_description *wiring = &reader->world->wiring;
    const struct world_line *line = &reader->line;
    const char *kind = line->count > 1 ? line->words[1] : "";
    wiring->is_buffered = strcmp(kind, "buffered") == 0;
    if (!wiring->is_buffered && strcmp(kind, "passive") != 0) {
        return world_line_report_error(line, "expected 'passive' or 'buffered' after 'wiring'");
    }
    return read_pullup(line, 2, &wiring->hub_pullup_ohm) ||
                   world_line_read_number(line, 3, 0.0, PICOFARAD_MAX, &wiring->hub_capacitance_pf)
               ? -1
               : 0;
}

/* Return whether a name consists of letters, digits, '_', '-' and '.', and is not longer than permitted. */
static bool is_valid_name(const char *name)
{
    const size_t size = strlen(name);
    for (size_t i = 0; i < size; i++) {
        if (!isalnum((unsigned char)name[i]) && !strchr("_-.", name[i])) {
            return false;
        }
    }
    return size > 0 && size < WIRING_NAME_SIZE;
}

/* Read name and electrical values of a branch line. Returns 0, or -1 after an error line on stderr. */
static int read_description(const struct world_line *line, struct branch_description *branch)
{
    memset(branch, 0, sizeof *branch);
    if (line->count < 2 || !is_valid_name(line->words[1])) {
        return world_line_report_error(line, "a branch needs a name of at most 31 letters, digits, '_', '-' or '.'");
    }
    memcpy(branch->name, line->words[1], strlen(line->words[1]));
    return read_pullup(line, 2, &branch->pullup_ohm) ||
                   world_line_read_number(line, 3, 0.1, PICOFARAD_MAX, &branch->capacitance_pf) ||
                   world_line_read_number(line, 4, 0.0, OHM_MAX, &branch->series_ohm)
               ? -1
               : 0;
}

/* Add a branch unless the wiring has one with this name and these values. Returns the number of the branch from 1; 0
 * after an error line on stderr. */
static size_t add_branch(const struct world_reader *reader, const struct branch_description *branch)
{
    struct wiring_description *wiring = &reader->world->wiring;
    for (size_t i = 0; i < wiring->branch_count; i++) {
        const struct branch_description *present = &wiring->branches[i];
        if (strcmp(present->name, branch->name) == 0) {
            if (present->pullup_ohm == branch->pullup_ohm && present->capacitance_pf == branch->capacitance_pf &&
                present->series_ohm == branch->series_ohm) {
                return i + 1u;
            }
            (void)world_line_report_error(&reader->line, "an earlier line gives this branch other values");
            return 0;
        }
    }
    if (wiring->branch_count == WIRING_BRANCHES_MAX) {
        (void)world_line_report_error(&reader->line, "more branches than the maximum of 16");
        return 0;
    }
    wiring->branches[wiring->branch_count++] = *branch;
    return wiring->branch_count;
}

/* Read a line of a world file: branch NAME PULLUP_OHM CAPACITANCE_PF SERIES_OHM ADDRESS... A second line with the same
 * name and values adds boards. Returns 0, or -1 after an error line on stderr. */
static int read_branch(const struct world_reader *reader)
{
    const struct world_line *line = &reader->line;
    struct wiring_description *wiring = &reader->world->wiring;
    struct branch_description branch;
    if (read_description(line, &branch)) {
        return -1;
    }
    if (line->count < 6 || line->count == WORLD_LINE_WORDS_MAX) { /* words beyond the maximum are lost */
        return world_line_report_error(line,
                                       "expected 1 to 18 addresses; a second line with the same name adds boards");
    }
    const size_t number = add_branch(reader, &branch);
    for (int i = 5; number && i < line->count; i++) {
        const int board = world_reader_find_board(reader, i);
        if (board < 0) {
            return -1;
        }
        uint8_t *present = &wiring->branch_of[reader->world->boards[board].address];
        if (*present && *present != number) {
            return world_line_report_error(line, "a board of this line belongs to another branch");
        }
        *present = (uint8_t)number;
    }
    return number ? 0 : -1;
}

/* Read a line with the keyword `wiring` or `branch`. Returns 0, 1 for another keyword, or -1 after an error line on
 * stderr. */
int world_wiring_read_line(const struct world_reader *reader)
{
    if (strcmp(reader->line.words[0], "wiring") == 0) {
        return read_wiring(reader);
    }
    if (strcmp(reader->line.words[0], "branch") == 0) {
        return read_branch(reader);
    }
    return 1;
}
