/* A moist patch: water has crept between the pillars of one board.
 *
 * Water takes a share w of the layer's pores. By the layer's own mixing rule (Lichtenecker, by volume) its permittivity is
 * multiplied by WATER_PERMITTIVITY ^ (w v), where v is the share of the layer's volume that is not silicone. At rest that is
 * a rise; under pressure the water leaves with the air, v goes to 0, and so the moist layer answers less to a press than the
 * dry one. The patch is a disc of radius_m on the unrolled sheet about (tx, rx), in lines from 0 (2.5: between two lines);
 * across its edge w falls as (1 - tanh((d - radius_m) / edge_m)) / 2.
 *
 * Form `film`: w = water for good. Form `drying`: w = water exp(-t / seconds) from the world's begin, so that rest drifts. */
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
    size_t board; /* its place in the description */
    double tx, rx, radius_m, edge_m, water, seconds;
};

int moisture_read(struct effect_line *line, struct effects *effects);
bool moisture_is_on(const struct moisture_effect *moisture);

/* How much of the patch's water each cell has, 0 to 1. weight [cells]. */
void moisture_fill(const struct moisture_effect *moisture, const struct patch *patch, double *weight);

/* The water's share of the pores at a time, seconds; 0 when it has gone. */
double moisture_water(const struct moisture_effect *moisture, double time);

/* The relative rise of a cell whose pores hold that share of water, from its rise when dry. */
double moisture_rise(double water, double rise);

#endif
