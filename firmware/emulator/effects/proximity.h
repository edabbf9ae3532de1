/* Response of the fringe field before contact: the field extends beyond the layer into the object.
 *
 * `share`: contribution of an object in contact with the whole taxel, relative to the fringe capacitance at rest (a
 * signal of share * fringe capacitance * counts per farad). A cell at a gap g (metres) adds share * f(g) with f = 0 far
 * away; a touched cell has f(0). A taxel has the mean over its cells. t: thickness of the layer. The forms `image` and
 * `wedge` raise the capacitance, with f(0) = 1; the sign of the other forms depends on the target.
 *
 * Form `image`: two line electrodes at distance reach_m have images in the object's face at height z = t + g. Their
 * flux through that plane is proportional to L(z) = ln(1 + (reach_m / 2 z)^2). The model ends at far = 5 reach_m, where
 * less than 2 % remains for electrodes at distance reach_m = 4 t:
 *         f(g) = (L(t + g) - L(t + far)) / (L(t) - L(t + far)).
 *
 * Form `wedge`: only where skin and object separate at the edge of a contact, up to a gap of reach_m. The air film is
 * in series with the layer of relative permittivity e, so the remaining capacitance is S(g) = 1 / (1 + e g / t) and
 *         f(g) = (S(g) - S(reach_m)) / (1 - S(reach_m)).
 *
 * Forms `conductor` and `dielectric`: M(z) is the relative change of the mutual capacitance of two line electrodes at
 * the distance reach_m by the target (proximity_target.h), and M_0 that by a conductor at ground. In units of M_0 in
 * contact, up to far = 5 reach_m:
 *         f(g) = (M(t + g) - M(t + far)) / (M_0(t + far) - M_0(t)).
 * A conductor at ground therefore has f(0) = -1: it lowers the capacitance and raises the raw count. An isolated
 * conductor raises the capacitance; a dielectric raises it near the skin and changes it little farther away. The
 * electrodes of one crossing are modelled: `grounding` includes the coupling of the object to all other lines, which
 * are at ground while one TX line is driven, so that an isolated plate over many taxels is nearly at ground. */
#ifndef EMULATOR_EFFECTS_PROXIMITY_H
#define EMULATOR_EFFECTS_PROXIMITY_H

#include <stdbool.h>

struct effect_line;
struct effects;

enum proximity_form {
    PROXIMITY_IMAGE,
    PROXIMITY_WEDGE,
    PROXIMITY_CONDUCTOR,
    PROXIMITY_DIELECTRIC,
};

struct proximity_effect {
    enum proximity_form form;
    double share, reach_m;
    double grounding;                        /* of a conductor */
    double permittivity, target_thickness_m; /* of a dielectric */
};

#define PROXIMITY_STEPS 256

/* Table of share * f over u = t / (t + g), in which f is smooth. */
struct proximity_curve {
    double thickness, reach;   /* metres */
    double u_min, steps_per_u; /* u at `reach`; table steps per unit of u */
    double value[PROXIMITY_STEPS + 1];
};

int proximity_read(struct effect_line *line, struct effects *effects);
bool proximity_is_on(const struct proximity_effect *proximity);
/* Return the smallest gap (metres) at which an object has no influence; 0 if the effect is inactive. */
double proximity_reach(const struct proximity_effect *proximity);

/* Tabulate the contribution over the gap for a layer of `thickness` metres. */
void proximity_prepare(struct proximity_curve *curve, const struct proximity_effect *proximity, double thickness);

/* Return the contribution of an object at a gap (metres) to the relative rise of a cell's fringe capacitance. */
double proximity_rise(const struct proximity_curve *curve, double gap);

#endif
