/* Mutual capacitance of two electrodes below a target: electrostatics of the forms `conductor` and `dielectric`.
 *
 * Two line electrodes (TX and RX) lie at the distance d from each other, in the plane of the electrodes, above the
 * shield of the board. The target is a plane face at the height z above the electrodes. Per unit of length and of
 * 2 pi epsilon0, the potentials of two lines with equal charge follow from the spectrum of a line charge between two
 * plane reflectors (Smythe, Static and Dynamic Electricity, 3rd ed., chapter IV; images in the wave number q):
 *         p(x) = p_shield(x) - integral over q of 4 r e^(-2 q z) ((1 - e^(-2 q h)) / 2)^2 / (1 - r e^(-2 q (h + z)))
 *                cos(q x) / q
 *         p_shield(0) = ln(2 h / a),   p_shield(d) = ln(1 + (2 h / d)^2) / 2
 * with the depth h of the shield and the radius a of an electrode. The mutual capacitance is the coefficient of
 * induction of the two lines, C = p(d) / (p(0)^2 - p(d)^2).
 *
 * The target reflects the share r(q) of a field of wave number q: 1 for a conductor at ground; for a slab of the
 * thickness w and the permittivity e, with k = (e - 1) / (e + 1) and E = e^(-2 q w), r = k (1 - E) / (1 - k^2 E).
 *
 * A conductor that is not at ground follows the TX electrode: the flux between them is C_t = h / (h + z) (C_s - C),
 * where C_s = p(0) / (p(0)^2 - p(d)^2), and the same flux reaches the RX electrode. Without any other path to ground
 * the two are in series, which adds C_t / 2 (transmit mode of Smith et al., IBM Systems Journal 35 (1996) 587; a target
 * at ground is their shunt mode). */
#ifndef EMULATOR_EFFECTS_PROXIMITY_TARGET_H
#define EMULATOR_EFFECTS_PROXIMITY_TARGET_H

#include <stdbool.h>

/* The approaching object and the electrodes below it. */
struct proximity_target {
    bool is_conductor;
    double distance;     /* between the electrodes, metres */
    double grounding;    /* of a conductor: 1 at ground, 0 isolated */
    double permittivity; /* of a dielectric */
    double thickness;    /* of a dielectric, metres */
};

/* Return the relative change of the mutual capacitance of the electrodes that a target at the height `z` (metres) above
 * them causes: C with target / C without target - 1. */
double proximity_target_change(const struct proximity_target *target, double z);

#endif
