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

/* Return the distance (metres) between the cells at two positions of the grid; infinite if one of them has no cell. */
static double distance_between(const struct patch *patch, int row, int column, int other_row, int other_column)
{
    const bool is_inside = other_row >= 0 && other_column >= 0 && other_column < patch->grid_columns;
    const int index = patch->cell_at[row * patch->grid_columns + column];
    const int other = is_inside ? patch->cell_at[other_row * patch->grid_columns + other_column] : -1;
    if (index < 0 || other < 0) {
        return INFINITY;
    }
    const double *from = patch->cells[index].position, *to = patch->cells[other].position;
    return hypot(hypot(to[0] - from[0], to[1] - from[1]), to[2] - from[2]);
}

/* Convolve a row of cells with a kernel that falls by the factor attenuation[i] between positions i - 1 and i. One pass
 * per direction is sufficient. attenuation is 0 beside a position without a cell, so nothing propagates across a
 * gap. */
static void sum_row(const double *in, double *out, const double *attenuation, int columns)
{
    double from_before = 0.0, from_after = 0.0;
    for (int i = 0; i < columns; i++) {
        from_before = attenuation[i] * from_before + in[i];
        out[i] = from_before;
    }
    for (int i = columns - 1; i >= 0; i--) {
        out[i] += from_after;
        from_after = attenuation[i] * (from_after + in[i]);
    }
}

/* Convolve every column of the grid with a kernel that falls by the factor attenuation[i] between position i and the
 * position above it. As in sum_row(), one pass per direction is sufficient; each pass processes all columns
 * together. */
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
            out[i] += from_after[column];
            from_after[column] = attenuation[i] * (from_after[column] + in[i]);
        }
    }
}

/* Allocate the grid of cells (4 x 4 parts of each taxel) for the effect `spread pillars`, and compute the decrease of
 * the compression between neighbouring cells. The grid has a margin of one position on every side, so that every
 * position has eight neighbours. Returns 0, or -1 if out of memory. */
static int init_pillars(struct spread_state *state, double slope, const struct patch *patch)
{
    const int columns = patch->grid_columns, width = columns + 2, grid_size = width * (patch->grid_rows + 2);
    /* one block: the compressions, then the decreases to the SPREAD_NEIGHBOURS (4) earlier neighbours */
    state->value = malloc((size_t)(5 * grid_size) * sizeof *state->value);
    state->grid_index_of = malloc(patch->cell_count * sizeof *state->grid_index_of);
    if (!state->value || !state->grid_index_of) {
        return -1;
    }
    for (int i = 0; i < SPREAD_NEIGHBOURS; i++) {
        state->decrease[i] = state->value + (i + 1) * grid_size;
    }
    for (int i = 0; i < 5 * grid_size; i++) {
        state->value[i] = INFINITY;
    }
    state->smallest_decrease = INFINITY;
    for (size_t i = 0; i < patch->cell_count; i++) {
        const int row = patch->grid_of[i] / columns, column = patch->grid_of[i] % columns;
        const int index = (row + 1) * width + column + 1;
        state->grid_index_of[i] = index;
        const double distance[SPREAD_NEIGHBOURS] = {
            [SPREAD_BEFORE] = distance_between(patch, row, column, row, column - 1),
            [SPREAD_ABOVE] = distance_between(patch, row, column, row - 1, column),
            [SPREAD_ABOVE_BEFORE] = distance_between(patch, row, column, row - 1, column - 1),
            [SPREAD_ABOVE_AFTER] = distance_between(patch, row, column, row - 1, column + 1),
        };
        for (int k = 0; k < SPREAD_NEIGHBOURS; k++) {
            state->decrease[k][index] = slope * distance[k];
            state->smallest_decrease = fmin(state->smallest_decrease, state->decrease[k][index]);
        }
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
        return init_pillars(state, spread->slope, patch);
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
        const int row = i / columns, column = i % columns;
        state->attenuation[i] = exp(-distance_between(patch, row, column, row, column - 1) / spread->length_m);
        state->attenuation_down[i] = exp(-distance_between(patch, row, column, row - 1, column) / spread->length_m);
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
    free(state->attenuation ? state->attenuation : state->value); /* `film` has one block of memory for all arrays */
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

/* Extend compressions (metres) from one row of cells to the next: one step of a chamfer transform. Each position of
 * `row` takes the largest of its own compression and the reduced compressions of its three neighbours in row `from`.
 * The reductions are straight[i] for from[i], before[i] for from[i - 1] and after[i] for from[i + 1]; a reduction is
 * infinite where one of the two positions has no cell. */
static void grow_across(double *row, const double *from, const double *straight, const double *before,
                        const double *after, int columns)
{
    for (int i = 0; i < columns; i++) {
        const double corners[] = {from[i - 1] - before[i], from[i + 1] - after[i]}, middle = from[i] - straight[i];
        const double corner = corners[0] > corners[1] ? corners[0] : corners[1];
        const double largest = corner > middle ? corner : middle;
        row[i] = largest > row[i] ? largest : row[i];
    }
}

/* Extend compressions (metres) along one row of cells in direction +1 or -1: one step of a chamfer transform. Each
 * position takes the larger of its own compression and the reduced compression of its predecessor in this direction.
 * The reduction between positions i - 1 and i is decrease[i]. Returns whether the row can raise the next row: whether a
 * compression exceeds `smallest`, the smallest decrease between two cells. */
static bool grow_along(double *row, const double *decrease, double smallest, int columns, int direction)
{
    const int first = direction > 0 ? 0 : columns - 1;
    /* backward, the predecessor of position i is i + 1, so the reduction is decrease[i + 1] */
    const double *const hop = direction > 0 ? decrease : decrease + 1;
    bool can_grow = false;
    for (int n = 0, i = first; n < columns; n++, i += direction) {
        /* The condition is rarely true: branch prediction avoids waiting for the previous position. */
        if (row[i - direction] - hop[i] > row[i]) {
            row[i] = row[i - direction] - hop[i];
        }
        can_grow |= row[i] > smallest;
    }
    return can_grow;
}

/* Form `pillars`: extend the compression (metres) of each cell to its surroundings, falling by `slope` with the
 * distance. Two chamfer passes, forward and backward, over the grid of cells; rows without a compression that can raise
 * a neighbour are skipped. The decrease between two cells is stored at the later one, so the backward pass reads it in
 * the row below. */
void spread_compression(struct spread_state *state, const struct spread_effect *spread, const struct patch *patch,
                        double *compression)
{
    const int rows = patch->grid_rows, columns = patch->grid_columns, width = columns + 2;
    const double smallest = state->smallest_decrease;
    bool can_grow[GRID_MAX + 2] = {false};
    if (!state->grid_index_of) {
        return;
    }
    for (int i = 0; i < width * (rows + 2); i++) {
        state->value[i] = -INFINITY;
    }
    for (size_t i = 0; i < patch->cell_count; i++) {
        state->value[state->grid_index_of[i]] = compression[i];
        can_grow[state->grid_index_of[i] / width] |= compression[i] > smallest;
    }
    double *const *const decrease = state->decrease;
    for (int direction = 1; direction >= -1; direction -= 2) {
        for (int n = 1; n <= rows; n++) {
            const int row_index = direction > 0 ? n : rows + 1 - n, first = row_index * width + 1;
            double *const row = state->value + first;
            if (can_grow[row_index - direction] && direction > 0) {
                grow_across(row, row - width, decrease[SPREAD_ABOVE] + first, decrease[SPREAD_ABOVE_BEFORE] + first,
                            decrease[SPREAD_ABOVE_AFTER] + first, columns);
            } else if (can_grow[row_index - direction]) {
                const int below = first + width;
                grow_across(row, row + width, decrease[SPREAD_ABOVE] + below, decrease[SPREAD_ABOVE_AFTER] + below - 1,
                            decrease[SPREAD_ABOVE_BEFORE] + below + 1, columns);
            }
            if (can_grow[row_index - direction] || can_grow[row_index]) {
                can_grow[row_index] = grow_along(row, decrease[SPREAD_BEFORE] + first, smallest, columns, direction);
            }
        }
    }
    for (size_t i = 0; i < patch->cell_count; i++) {
        compression[i] += spread->strength * (state->value[state->grid_index_of[i]] - compression[i]);
    }
}
