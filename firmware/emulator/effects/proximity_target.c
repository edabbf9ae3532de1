#include "emulator/effects/proximity_target.h"

#include <math.h>

/* Assumed geometry of the electrodes, in units of their distance: the shield at half the distance, and strips of half
 * the distance in width, which have the field of a round wire of a quarter of their width. */
#define SHIELD_DEPTH 0.5
#define WIRE_RADIUS 0.125

/* Midpoint rule for the integral over the wave number q, up to the decay e^-16 of the field at the target. The steps
 * are uniform in the square root of q, because a thick slab changes its reflection at small q. */
#define WAVE_STEPS 160
#define WAVE_DECAY 8.0

/* Return the share of a field of wave number `q` (per metre) that the target reflects: 1 for a conductor; for a
 * dielectric slab the sum of the reflections at its two faces (k: reflection at one face; passage: attenuation of the
 * field on its way through the slab and back). */
static double compute_reflection(const struct proximity_target *target, double q)
{
    if (target->is_conductor) {
        return 1.0;
    }
    const double k = (target->permittivity - 1.0) / (target->permittivity + 1.0);
    const double passage = exp(-2.0 * q * target->thickness);
    return k * (1.0 - passage) / (1.0 - k * k * passage);
}

/* Coefficients of potential of the two electrodes: potential of an electrode by its own charge (p(0) in the header),
 * and by the charge of the other electrode (p(d)). */
struct potentials {
    double own, other;
};

/* Return the coefficients of potential without a target: each electrode (WIRE_RADIUS) with its image below the shield
 * (SHIELD_DEPTH); all lengths are in units of the distance of the electrodes. */
static struct potentials compute_potentials_at_rest(void)
{
    const double ratio = 2.0 * SHIELD_DEPTH;
    return (struct potentials){.own = log(2.0 * SHIELD_DEPTH / WIRE_RADIUS), .other = 0.5 * log1p(ratio * ratio)};
}

/* Return the coefficients of potential with a target at the height `z` (metres): the coefficients without a target
 * minus the field that the target reflects, integrated over the wave number q from 0 to q_max by the midpoint rule. The
 * steps are equal in the square root of q, and therefore shorter at small q. */
static struct potentials compute_potentials(const struct proximity_target *target, double z)
{
    const double depth = SHIELD_DEPTH * target->distance, q_max = WAVE_DECAY / z;
    struct potentials potentials = compute_potentials_at_rest();
    for (int i = 0; i < WAVE_STEPS; i++) {
        const double root = (i + 0.5) / WAVE_STEPS, q = q_max * root * root, step = 2.0 * q_max * root / WAVE_STEPS;
        const double reflection = compute_reflection(target, q);
        const double below = -0.5 * expm1(-2.0 * q * depth);
        const double reflected = 4.0 * reflection * exp(-2.0 * q * z) * below * below /
                                 (1.0 - reflection * exp(-2.0 * q * (depth + z))) / q * step;
        potentials.own -= reflected;
        potentials.other -= reflected * cos(q * target->distance);
    }
    return potentials;
}

/* Return the relative change of the mutual capacitance that a target at the height `z` (metres) causes. The mutual
 * capacitance follows from the inverse of the 2 x 2 matrix of the coefficients of potential. A
 * conductor that is not at ground passes flux from the TX to the RX electrode, which adds to the mutual capacitance. */
double proximity_target_change(const struct proximity_target *target, double z)
{
    const struct potentials rest = compute_potentials_at_rest(), near = compute_potentials(target, z);
    const double rest_mutual = rest.other / (rest.own * rest.own - rest.other * rest.other);
    const double determinant = near.own * near.own - near.other * near.other;
    double mutual = near.other / determinant;
    if (target->is_conductor) {
        const double depth = SHIELD_DEPTH * target->distance;
        mutual += (1.0 - target->grounding) * 0.5 * depth / (depth + z) * (near.own - near.other) / determinant;
    }
    return mutual / rest_mutual - 1.0;
}
