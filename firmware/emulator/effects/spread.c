#include "emulator/effects/spread.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/skin/patch.h"

#define GRID_MAX (TAXEL_LINES_MAX * CELLS_PER_SIDE)

int spread_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[SPREAD_FILM] = "film", [SPREAD_PILLARS] = "pillars", NULL};
    struct spread_effect *spread = &effects->spread;
    const int form = effect_line_form(line, forms);
    if (form < 0 || effect_line_optional(line, "strength", 0.0, 1.0, 1.0, &spread->strength)) {
        return -1;
    }
    spread->form = (enum spread_form)form;
    return form == SPREAD_FILM ? effect_line_number(line, "length_m", 1e-5, 0.02, &spread->length_m)
                               : effect_line_number(line, "slope", 0.01, 10.0, &spread->slope);
}

bool spread_is_on(const struct spread_effect *spread)
{
    return spread->strength != 0.0;
}

/* Sums over a row of the sheet with weights keep^distance, there and back; `keep` is 0 at a place without a cell, and so is
 * the value there: nothing gets past it. */
static void sum_row(const double *in, double *out, const double *keep, int columns)
{
    double behind = 0.0, ahead = 0.0;
    for (int i = 0; i < columns; i++) {
        behind = keep[i] * behind + in[i];
        out[i] = behind;
    }
    for (int i = columns - 1; i >= 0; i--) {
        out[i] += keep[i] * ahead;
        ahead = keep[i] * ahead + in[i];
    }
}

/* The same over all columns at once. */
static void sum_columns(const double *in, double *out, const double *keep, int rows, int columns)
{
    double ahead[GRID_MAX] = {0.0};
    memcpy(out, in, (size_t)columns * sizeof *out);
    for (int i = columns; i < rows * columns; i++) {
        out[i] = keep[i] * out[i - columns] + in[i];
    }
    for (int row = rows - 1; row >= 0; row--) {
        for (int column = 0; column < columns; column++) {
            const int i = row * columns + column;
            out[i] += keep[i] * ahead[column];
            ahead[column] = keep[i] * ahead[column] + in[i];
        }
    }
}

/* A margin of one place all around, so that every place has its eight neighbours. */
static int init_pillars(struct spread_state *state, const struct patch *patch)
{
    const int width = patch->grid_columns + 2, places = width * (patch->grid_rows + 2);
    state->wall = malloc((size_t)(2 * places) * sizeof *state->wall);
    state->place_of = malloc(patch->cell_count * sizeof *state->place_of);
    if (!state->wall || !state->place_of) {
        return -1;
    }
    state->value = state->wall + places;
    for (int i = 0; i < places; i++) {
        state->wall[i] = -INFINITY;
    }
    for (size_t i = 0; i < patch->cell_count; i++) {
        const int row = patch->grid_of[i] / patch->grid_columns, column = patch->grid_of[i] % patch->grid_columns;
        state->place_of[i] = (row + 1) * width + column + 1;
        state->wall[state->place_of[i]] = 0.0;
    }
    return 0;
}

int spread_init(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch)
{
    const int rows = patch->grid_rows, columns = patch->grid_columns, places = rows * columns;
    memset(state, 0, sizeof *state);
    if (!spread_is_on(spread)) {
        return 0;
    }
    if (spread->form == SPREAD_PILLARS) {
        return init_pillars(state, patch);
    }
    state->keep = calloc((size_t)(4 * places), sizeof *state->keep);
    if (!state->keep) {
        return -1;
    }
    state->along_row = state->keep + places;
    state->along_column = state->along_row + places;
    state->value = state->along_column + places;
    for (int i = 0; i < places; i++) {
        state->keep[i] = patch->cell_at[i] >= 0 ? exp(-CELL_SIDE_M / spread->length_m) : 0.0;
        state->value[i] = patch->cell_at[i] >= 0 ? 1.0 : 0.0;
    }
    for (int row = 0; row < rows; row++) {
        const int first = row * columns;
        sum_row(state->value + first, state->along_row + first, state->keep + first, columns);
    }
    sum_columns(state->value, state->along_column, state->keep, rows, columns);
    for (int i = 0; i < places; i++) {
        state->along_row[i] = patch->cell_at[i] >= 0 ? 1.0 / state->along_row[i] : 0.0;
        state->along_column[i] = patch->cell_at[i] >= 0 ? 1.0 / state->along_column[i] : 0.0;
    }
    return 0;
}

void spread_free(struct spread_state *state)
{
    free(state->keep);
    free(state->wall);
    free(state->place_of);
    memset(state, 0, sizeof *state);
}

/* Each cell gives its pressure away in full: divided first by the sum of its weights. */
void spread_pressure(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch, double *pressure)
{
    const int rows = patch->grid_rows, columns = patch->grid_columns;
    double line[GRID_MAX];
    double out[GRID_MAX * GRID_MAX];
    if (!state->keep) {
        return;
    }
    memset(state->value, 0, (size_t)(rows * columns) * sizeof *state->value);
    for (size_t i = 0; i < patch->cell_count; i++) {
        state->value[patch->grid_of[i]] = pressure[i];
    }
    for (int first = 0; first < rows * columns; first += columns) {
        bool any = false;
        for (int i = 0; i < columns; i++) {
            line[i] = state->value[first + i] * state->along_row[first + i];
            any = any || line[i] != 0.0;
        }
        if (any) {
            sum_row(line, state->value + first, state->keep + first, columns);
        }
    }
    for (int i = 0; i < rows * columns; i++) {
        state->value[i] *= state->along_column[i];
    }
    sum_columns(state->value, out, state->keep, rows, columns);
    for (size_t i = 0; i < patch->cell_count; i++) {
        pressure[i] += spread->strength * (out[patch->grid_of[i]] - pressure[i]);
    }
}

/* Chamfer passes: each place takes the larger of its own value and its neighbour's less the slope over the way. `from`: the row
 * that has been passed before; `wall` lets nothing stay at a place without a cell. */
static void grow_across(double *row, const double *from, const double *wall, double drop, int columns)
{
    const double aslant = drop * 1.4142135623730951;
    for (int i = 0; i < columns; i++) {
        const double beside = from[i - 1] > from[i + 1] ? from[i - 1] : from[i + 1];
        const double corner = beside - aslant, straight = from[i] - drop;
        const double most = corner > straight ? corner : straight;
        row[i] = (most > row[i] ? most : row[i]) + wall[i];
    }
}

/* Returns whether the row has anything to give to others. */
static bool grow_along(double *row, const double *wall, double drop, int columns, int direction)
{
    const int first = direction > 0 ? 0 : columns - 1;
    bool gives = false;
    for (int n = 0, i = first; n < columns; n++, i += direction) {
        if (row[i - direction] - drop > row[i]) { /* seldom: a jump here does not wait for the place before */
            row[i] = row[i - direction] - drop + wall[i];
        }
        gives |= row[i] > drop;
    }
    return gives;
}

void spread_compression(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch,
                        double *compression)
{
    const int rows = patch->grid_rows, columns = patch->grid_columns, width = columns + 2;
    const double drop = spread->slope * CELL_SIDE_M;
    bool gives[GRID_MAX + 2] = {false};
    if (!state->wall) {
        return;
    }
    memcpy(state->value, state->wall, (size_t)(width * (rows + 2)) * sizeof *state->value);
    for (size_t i = 0; i < patch->cell_count; i++) {
        state->value[state->place_of[i]] = compression[i];
        gives[state->place_of[i] / width] |= compression[i] > drop;
    }
    for (int direction = 1; direction >= -1; direction -= 2) {
        for (int n = 1; n <= rows; n++) {
            const int number = direction > 0 ? n : rows + 1 - n, first = number * width + 1;
            double *const row = state->value + first;
            if (gives[number - direction]) {
                grow_across(row, row - direction * width, state->wall + first, drop, columns);
            }
            if (gives[number - direction] || gives[number]) {
                gives[number] = grow_along(row, state->wall + first, drop, columns, direction);
            }
        }
    }
    for (size_t i = 0; i < patch->cell_count; i++) {
        compression[i] += spread->strength * (state->value[state->place_of[i]] - compression[i]);
    }
}
