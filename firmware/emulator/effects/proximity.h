/* The fringe field answers before contact: it reaches out of the layer into a dielectric object.
 *
 * `share`: what an object that lies on the whole taxel adds, as a share of the fringe capacitance at rest (a drop of share
 * * fringe capacitance * counts per farad). A cell at a gap g (metres) adds share * f(g), f(0) = 1, and f = 0 far
 * away; a touched cell keeps f = 1. Over a taxel its cells' parts are averaged. t: thickness of the layer.
 *
 * Form `image`: two line electrodes reach_m apart see their images in the object's face, a height z = t + g above them. The
 * flux between them that goes through that plane is proportional to L(z) = ln(1 + (reach_m / 2 z)^2). It is followed up to
 * far = 5 reach_m, where less than 2 % of it is left with electrodes reach_m = 4 t apart:
 *     f(g) = (L(t + g) - L(t + far)) / (L(t) - L(t + far)).
 *
 * Form `wedge`: only where skin and object part at a contact's edge, up to a gap of reach_m: there a film of air lies in
 * series with the layer, relative permittivity e. Of the layer's capacitance S(g) = 1 / (1 + e g / t) is left, so
 *     f(g) = (S(g) - S(reach_m)) / (1 - S(reach_m)). */
#ifndef EMULATOR_EFFECTS_PROXIMITY_H
#define EMULATOR_EFFECTS_PROXIMITY_H

#include <stdbool.h>

struct effect_line;
struct effects;

enum proximity_form {
    PROXIMITY_IMAGE,
    PROXIMITY_WEDGE,
};

struct proximity_effect {
    enum proximity_form form;
    double share, reach_m;
};

#define PROXIMITY_STEPS 256

/* share * f over u = t / (t + g), in which it is smooth. */
struct proximity_curve {
    double thickness, far; /* metres */
    double floor, steps;   /* u at `far`; steps a unit of u */
    double value[PROXIMITY_STEPS + 1];
};

int proximity_read(struct effect_line *line, struct effects *effects);
bool proximity_is_on(const struct proximity_effect *proximity);
double proximity_far(const struct proximity_effect *proximity); /* the gap from which on nothing is added; 0 if off */
void proximity_prepare(struct proximity_curve *curve, const struct proximity_effect *proximity, double thickness);

/* What a cell at that gap adds to the relative rise. */
double proximity_rise(const struct proximity_curve *curve, double gap);

#endif
