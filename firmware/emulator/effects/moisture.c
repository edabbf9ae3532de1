#include "emulator/effects/moisture.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/physics/layer.h"
#include "emulator/geometry/patch.h"

#define WATER_PERMITTIVITY 80.0 /* at 20 degrees C, below 1 GHz */
#define NEGLIGIBLE_WATER 1e-7   /* water fraction with an effect far below one count */

/* Read a world-file line `effect moisture`: a moist disc on one board, centred at row `tx` and column `rx`, with radius
 * and edge width in metres and `water` as a share of the pore volume. Returns 0, or -1 after an error line on stderr.
 */
int moisture_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[MOISTURE_FILM] = "film", [MOISTURE_DRYING] = "drying", NULL};
    struct moisture_effect *moisture = &effects->moisture;
    const int form = effect_line_form_index(line, forms);
    if (form < 0) {
        return -1;
    }
    *moisture = (struct moisture_effect){.form = (enum moisture_form)form};
    if (effect_line_board(line, &moisture->board) ||
        effect_line_number(line, "tx", -1.0, TAXEL_LINES_MAX, &moisture->tx) ||
        effect_line_number(line, "rx", -1.0, TAXEL_LINES_MAX, &moisture->rx) ||
        effect_line_number(line, "radius_m", 0.0, 0.1, &moisture->radius_m) ||
        effect_line_optional(line, "edge_m", 1e-4, 0.02, 0.001, &moisture->edge_m) ||
        effect_line_number(line, "water", 0.0, 0.3, &moisture->water)) {
        return -1;
    }
    return form == MOISTURE_DRYING ? effect_line_number(line, "seconds", 0.1, 1e6, &moisture->seconds) : 0;
}

/* Return whether the world file requests the effect `moisture`: the patch contains water. */
bool moisture_is_on(const struct moisture_effect *moisture)
{
    return moisture->water != 0.0;
}

/* Write the share (0 to 1) of the patch's water content for each cell of the board: 1 inside the moist disc, 0
 * outside, with a tanh edge. Shares with an influence far below one count are set to 0, so that dry cells need no
 * computation. */
void moisture_fill(const struct moisture_effect *moisture, const struct patch *patch, double *weight)
{
    for (size_t i = 0; i < patch->cell_count; i++) {
        const int row = patch->grid_of[i] / patch->grid_columns, column = patch->grid_of[i] % patch->grid_columns;
        const double along = (row + 0.5 - (moisture->tx + 0.5) * CELLS_PER_SIDE) * patch->step[0];
        const double across = (column + 0.5 - (moisture->rx + 0.5) * CELLS_PER_SIDE) * patch->step[1];
        const double share = 0.5 * (1.0 - tanh((hypot(along, across) - moisture->radius_m) / moisture->edge_m));
        weight[i] = share < NEGLIGIBLE_WATER ? 0.0 : share;
    }
}

/* Return the water content at the centre of the moist patch at `time` (seconds), as a share of the pore volume. A
 * drying patch loses its water exponentially. */
double moisture_water(const struct moisture_effect *moisture, double time)
{
    if (moisture->form == MOISTURE_FILM) {
        return moisture->water;
    }
    const double water = moisture->water * exp(-time / moisture->seconds);
    return water < NEGLIGIBLE_WATER ? 0.0 : water;
}

/* Return the relative rise of the permittivity of a cell whose pores contain the share `water` of water, from the rise
 * of the dry cell. Lichtenecker's rule: water multiplies the permittivity by 80^(water * air fraction). */
double moisture_rise(double water, double rise)
{
    return rise + (1.0 + rise) * expm1(water * log(WATER_PERMITTIVITY) * layer_air_fraction(rise));
}
