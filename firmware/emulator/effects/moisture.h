/* Moist patch: water between the pillars of one board.
 *
 * Water fills a share w of the layer's pores. By the mixing rule of the layer (Lichtenecker, by volume) its
 * permittivity is multiplied by WATER_PERMITTIVITY ^ (w v), where v is the volume fraction that is not silicone. At
 * rest the permittivity rises; under pressure the water leaves with the air and v approaches 0, so the moist layer has
 * a smaller response than the dry layer. The patch is a disc of radius_m on the unrolled sheet, centred at (tx, rx) in
 * lines from 0 (2.5: between two lines); w falls across its edge as (1 - tanh((d - radius_m) / edge_m)) / 2.
 *
 * Form `film`: w = water, constant. Form `drying`: w = water exp(-t / seconds) from the start of the world, so the rest
 * counts drift. */
#ifndef EMULATOR_EFFECTS_MOISTURE_H
#define EMULATOR_EFFECTS_MOISTURE_H

#include <stdbool.h>
#include <stddef.h>

struct effect_line;
struct effects;
struct patch;

enum moisture_form {
    MOISTURE_FILM,
    MOISTURE_DRYING,
};

struct moisture_effect {
    enum moisture_form form;
    size_t board; /* index in the description */
    double tx, rx, radius_m, edge_m, water, seconds;
};

int moisture_read(struct effect_line *line, struct effects *effects);
bool moisture_is_on(const struct moisture_effect *moisture);

/* Write the share of the patch's water in each cell, 0 to 1. weight [cells]: result. */
void moisture_fill(const struct moisture_effect *moisture, const struct patch *patch, double *weight);

/* Return the share of the pores that water fills at the centre of the patch at a time in seconds; 0 after drying. */
double moisture_water(const struct moisture_effect *moisture, double time);

/* Return the relative rise of the permittivity of a cell with the share `water` of water in its pores, from its dry
 * rise. */
double moisture_rise(double water, double rise);

#endif
