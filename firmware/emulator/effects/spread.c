#include "emulator/effects/spread.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/geometry/patch.h"

#define GRID_MAX (TAXEL_LINES_MAX * CELLS_PER_SIDE)

/* Read the parameters of a world-file line `effect spread` into effects->spread. Form `film`: the key `length_m` is the
 * decay length of pressure in the cover film, metres. Form `pillars`: the key `slope` is the decrease of the
 * compression with the distance from a compressed cell (one of the 4 x 4 parts of a taxel), metres per metre. Both
 * forms: the optional key `strength` interpolates between no effect (0) and the full effect (1, the default). Returns
 * 0, or -1 after an error line on stderr. */
int spread_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[SPREAD_FILM] = "film", [SPREAD_PILLARS] = "pillars", NULL};
    struct spread_effect *spread = &effects->spread;
    const int form = effect_line_form_index(line, forms);
    if (form < 0 || effect_line_optional(line, "strength", 0.0, 1.0, 1.0, &spread->strength)) {
        return -1;
    }
    spread->form = (enum spread_form)form;
    return form == SPREAD_FILM ? effect_line_number(line, "length_m", 1e-5, 0.02, &spread->length_m)
                               : effect_line_number(line, "slope", 0.01, 10.0, &spread->slope);
}

/* Return whether the world file requests the effect `spread` (lateral spreading of contact) with a nonzero strength. */
bool spread_is_on(const struct spread_effect *spread)
{
    return spread->strength != 0.0;
}

/* Convolve a row of cells with the kernel attenuation^distance, in one pass per direction. attenuation and `in` are 0
 * where the sheet has no cell, so nothing propagates across a gap. */
static void sum_row(const double *in, double *out, const double *attenuation, int columns)
{
    double from_before = 0.0, from_after = 0.0;
    for (int i = 0; i < columns; i++) {
        from_before = attenuation[i] * from_before + in[i];
        out[i] = from_before;
    }
    for (int i = columns - 1; i >= 0; i--) {
        out[i] += attenuation[i] * from_after;
        from_after = attenuation[i] * from_after + in[i];
    }
}

/* Convolve every column of the grid with the kernel attenuation^distance, all columns at once, in one pass per
 * direction. attenuation and `in` are 0 where the sheet has no cell. */
static void sum_columns(const double *in, double *out, const double *attenuation, int rows, int columns)
{
    double from_after[GRID_MAX] = {0.0};
    memcpy(out, in, (size_t)columns * sizeof *out);
    for (int i = columns; i < rows * columns; i++) {
        out[i] = attenuation[i] * out[i - columns] + in[i];
    }
    for (int row = rows - 1; row >= 0; row--) {
        for (int column = 0; column < columns; column++) {
            const int i = row * columns + column;
            out[i] += attenuation[i] * from_after[column];
            from_after[column] = attenuation[i] * from_after[column] + in[i];
        }
    }
}

/* Allocate the grid of cells for the effect `spread pillars`. It has a margin of one position on every side, so
 * that every position has eight neighbours. Returns 0, or -1 if out of memory. */
static int init_pillars(struct spread_state *state, const struct patch *patch)
{
    const int width = patch->grid_columns + 2, grid_size = width * (patch->grid_rows + 2);
    state->barrier = malloc((size_t)(2 * grid_size) * sizeof *state->barrier);
    state->grid_index_of = malloc(patch->cell_count * sizeof *state->grid_index_of);
    if (!state->barrier || !state->grid_index_of) {
        return -1;
    }
    state->value = state->barrier + grid_size;
    for (int i = 0; i < grid_size; i++) {
        state->barrier[i] = -INFINITY;
    }
    for (size_t i = 0; i < patch->cell_count; i++) {
        const int row = patch->grid_of[i] / patch->grid_columns, column = patch->grid_of[i] % patch->grid_columns;
        state->grid_index_of[i] = (row + 1) * width + column + 1;
        state->barrier[state->grid_index_of[i]] = 0.0;
    }
    return 0;
}

/* Allocate the grids of the effect for one board; nothing if the effect is off. For form `film` also compute 1 / (sum
 * of the kernel weights) of each cell along its row and its column, so that smoothing preserves the total force at the
 * edges of the sheet. Returns 0, or -1 if out of memory. */
int spread_init(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch)
{
    const int rows = patch->grid_rows, columns = patch->grid_columns, grid_size = rows * columns;
    memset(state, 0, sizeof *state);
    if (!spread_is_on(spread)) {
        return 0;
    }
    if (spread->form == SPREAD_PILLARS) {
        return init_pillars(state, patch);
    }
    state->attenuation = calloc(5u * (size_t)grid_size, sizeof *state->attenuation);
    if (!state->attenuation) {
        return -1;
    }
    state->attenuation_down = state->attenuation + grid_size;
    state->along_row = state->attenuation_down + grid_size;
    state->along_column = state->along_row + grid_size;
    state->value = state->along_column + grid_size;
    for (int i = 0; i < grid_size; i++) {
        state->attenuation[i] = patch->cell_at[i] >= 0 ? exp(-patch->step[1] / spread->length_m) : 0.0;
        state->attenuation_down[i] = patch->cell_at[i] >= 0 ? exp(-patch->step[0] / spread->length_m) : 0.0;
        state->value[i] = patch->cell_at[i] >= 0 ? 1.0 : 0.0;
    }
    for (int row = 0; row < rows; row++) {
        const int first = row * columns;
        sum_row(state->value + first, state->along_row + first, state->attenuation + first, columns);
    }
    sum_columns(state->value, state->along_column, state->attenuation_down, rows, columns);
    for (int i = 0; i < grid_size; i++) {
        state->along_row[i] = patch->cell_at[i] >= 0 ? 1.0 / state->along_row[i] : 0.0;
        state->along_column[i] = patch->cell_at[i] >= 0 ? 1.0 / state->along_column[i] : 0.0;
    }
    return 0;
}

/* Free the memory of the effect `spread` and clear its state. */
void spread_free(struct spread_state *state)
{
    free(state->attenuation);
    free(state->barrier);
    free(state->grid_index_of);
    memset(state, 0, sizeof *state);
}

/* Form `film`: smooth the pressure (pascal) of the cells along rows and columns with a kernel that falls exponentially.
 * The weights of each source cell are normalised to 1, so that the total force is preserved. */
void spread_pressure(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch,
                     double *pressure)
{
    const int rows = patch->grid_rows, columns = patch->grid_columns;
    double line[GRID_MAX];
    double out[GRID_MAX * GRID_MAX];
    if (!state->attenuation) {
        return;
    }
    memset(state->value, 0, (size_t)(rows * columns) * sizeof *state->value);
    for (size_t i = 0; i < patch->cell_count; i++) {
        state->value[patch->grid_of[i]] = pressure[i] * patch->cells[i].area; /* the kernel preserves the force */
    }
    for (int first = 0; first < rows * columns; first += columns) {
        bool is_nonzero = false;
        for (int i = 0; i < columns; i++) {
            line[i] = state->value[first + i] * state->along_row[first + i];
            is_nonzero = is_nonzero || line[i] != 0.0;
        }
        if (is_nonzero) {
            sum_row(line, state->value + first, state->attenuation + first, columns);
        }
    }
    for (int i = 0; i < rows * columns; i++) {
        state->value[i] *= state->along_column[i];
    }
    sum_columns(state->value, out, state->attenuation_down, rows, columns);
    for (size_t i = 0; i < patch->cell_count; i++) {
        pressure[i] += spread->strength * (out[patch->grid_of[i]] / patch->cells[i].area - pressure[i]);
    }
}

/* Extend compressions from one row of cells to the next, by a chamfer pass: each position of `row` takes the larger of
 * its own compression and those of its three neighbours in row `from`, minus the slope times their distance. decrement:
 * slope times the distance between neighbours along a column (0) and along a row (1), metres. The barrier (-INFINITY)
 * removes values at positions without a cell. */
static void grow_across(double *row, const double *from, const double *barrier, const double decrement[2], int columns)
{
    const double diagonal_decrement = hypot(decrement[0], decrement[1]);
    for (int i = 0; i < columns; i++) {
        const double neighbour = from[i - 1] > from[i + 1] ? from[i - 1] : from[i + 1];
        const double corner = neighbour - diagonal_decrement, straight = from[i] - decrement[0];
        const double largest = corner > straight ? corner : straight;
        row[i] = (largest > row[i] ? largest : row[i]) + barrier[i];
    }
}

/* Extend compressions along one row of cells, by a chamfer pass in direction +1 or -1: each position takes the larger
 * of its own compression and that of the position before it minus `decrement`. Returns whether the row can raise the
 * next row: whether a compression exceeds `smallest`, the smaller decrement of rows and columns. */
static bool grow_along(double *row, const double *barrier, double decrement, double smallest, int columns,
                       int direction)
{
    const int first = direction > 0 ? 0 : columns - 1;
    bool can_grow = false;
    for (int n = 0, i = first; n < columns; n++, i += direction) {
        /* The condition is rarely true: branch prediction avoids waiting for the previous position. */
        if (row[i - direction] - decrement > row[i]) {
            row[i] = row[i - direction] - decrement + barrier[i];
        }
        can_grow |= row[i] > smallest;
    }
    return can_grow;
}

/* Form `pillars`: extend the compression (metres) of each cell to its surroundings, falling by `slope` with distance.
 * Two chamfer passes, forward and backward, over the grid of cells; rows without a compression that can raise a
 * neighbour are skipped. */
void spread_compression(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch,
                        double *compression)
{
    const int rows = patch->grid_rows, columns = patch->grid_columns, width = columns + 2;
    const double decrement[2] = {spread->slope * patch->step[0], spread->slope * patch->step[1]};
    const double smallest = fmin(decrement[0], decrement[1]);
    bool can_grow[GRID_MAX + 2] = {false};
    if (!state->barrier) {
        return;
    }
    memcpy(state->value, state->barrier, (size_t)(width * (rows + 2)) * sizeof *state->value);
    for (size_t i = 0; i < patch->cell_count; i++) {
        state->value[state->grid_index_of[i]] = compression[i];
        can_grow[state->grid_index_of[i] / width] |= compression[i] > smallest;
    }
    for (int direction = 1; direction >= -1; direction -= 2) {
        for (int n = 1; n <= rows; n++) {
            const int row_index = direction > 0 ? n : rows + 1 - n, first = row_index * width + 1;
            double *const row = state->value + first;
            if (can_grow[row_index - direction]) {
                grow_across(row, row - direction * width, state->barrier + first, decrement, columns);
            }
            if (can_grow[row_index - direction] || can_grow[row_index]) {
                can_grow[row_index] =
                    grow_along(row, state->barrier + first, decrement[1], smallest, columns, direction);
            }
        }
    }
    for (size_t i = 0; i < patch->cell_count; i++) {
        compression[i] += spread->strength * (state->value[state->grid_index_of[i]] - compression[i]);
    }
}
