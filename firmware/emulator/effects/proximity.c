#include "emulator/effects/proximity.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/effects/proximity_target.h"
#include "emulator/physics/layer.h"
#include "emulator/geometry/contact.h"

#define IMAGE_FAR 5.0 /* in units of the electrode distance */

/* Read the keys that describe the target (the approaching object) for the forms `conductor` and `dielectric`. Returns
 * 0, or -1 after an error line on stderr. */
static int read_target(struct effect_line *line, struct proximity_effect *proximity)
{
    proximity->grounding = 1.0;
    if (proximity->form == PROXIMITY_CONDUCTOR) {
        return effect_line_optional(line, "grounding", 0.0, 1.0, 1.0, &proximity->grounding);
    }
    if (proximity->form == PROXIMITY_DIELECTRIC) {
        return effect_line_number(line, "permittivity", 1.0, 100.0, &proximity->permittivity) ||
                       effect_line_optional(line, "thickness_m", 1e-4, CONTACT_FAR_M, CONTACT_FAR_M,
                                            &proximity->target_thickness_m)
                   ? -1
                   : 0;
    }
    return 0;
}

/* Read a world-file line `effect proximity`: the response to an object that does not touch yet (`share` of the fringe
 * capacitance), the distance in metres over which it decays, and the target. Returns 0, or -1 after an error line on
 * stderr. */
int proximity_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {
        [PROXIMITY_IMAGE] = "image",
        [PROXIMITY_WEDGE] = "wedge",
        [PROXIMITY_CONDUCTOR] = "conductor",
        [PROXIMITY_DIELECTRIC] = "dielectric",
        NULL,
    };
    const int form = effect_line_form_index(line, forms);
    if (form < 0) {
        return -1;
    }
    effects->proximity = (struct proximity_effect){.form = (enum proximity_form)form};
    return effect_line_number(line, "share", 0.0, 1.0, &effects->proximity.share) ||
                   effect_line_number(line, "reach_m", 1e-5, 0.02, &effects->proximity.reach_m) ||
                   read_target(line, &effects->proximity)
               ? -1
               : 0;
}

/* Return whether the world file requests the effect `proximity` (signal before contact): its share is not 0. */
bool proximity_is_on(const struct proximity_effect *proximity)
{
    return proximity->share != 0.0;
}

/* Return the smallest gap (metres) at which an object has no influence; 0 if the effect is inactive. */
double proximity_reach(const struct proximity_effect *proximity)
{
    const double reach = proximity->form == PROXIMITY_WEDGE ? proximity->reach_m : IMAGE_FAR * proximity->reach_m;
    return proximity_is_on(proximity) ? fmin(reach, CONTACT_FAR_M) : 0.0;
}

/* Return the target of the forms `conductor` and `dielectric` as the argument of the electrostatic model. */
static struct proximity_target make_target(const struct proximity_effect *proximity)
{
    return (struct proximity_target){
        .is_conductor = proximity->form == PROXIMITY_CONDUCTOR,
        .distance = proximity->reach_m,
        .grounding = proximity->grounding,
        .permittivity = proximity->permittivity,
        .thickness = proximity->target_thickness_m,
    };
}

/* Return the response to an object at a gap (metres), not normalised. Form `image`: the flux of two line electrodes
 * through the face of the object. Form `wedge`: the series capacitance of an air film and the layer. Other forms: the
 * relative change of the mutual capacitance of two line electrodes. thickness: of the layer, metres. */
static double compute_response(const struct proximity_effect *proximity, double thickness, double gap)
{
    if (proximity->form == PROXIMITY_WEDGE) {
        return 1.0 / (1.0 + layer_rest_permittivity() * gap / thickness);
    }
    if (proximity->form == PROXIMITY_IMAGE) {
        const double ratio = 0.5 * proximity->reach_m / (thickness + gap);
        return log1p(ratio * ratio);
    }
    const struct proximity_target target = make_target(proximity);
    return proximity_target_change(&target, thickness + gap);
}

/* Return the divisor that normalises the response to 1 in contact: for `image` and `wedge` the response in contact
 * minus that at the reach; for `conductor` and `dielectric` the decrease that a conductor at ground causes in contact,
 * whatever the target is. */
static double compute_scale(const struct proximity_effect *proximity, double thickness, double reach)
{
    if (proximity->form == PROXIMITY_IMAGE || proximity->form == PROXIMITY_WEDGE) {
        return compute_response(proximity, thickness, 0.0) - compute_response(proximity, thickness, reach);
    }
    const struct proximity_target ground = {.is_conductor = true, .distance = proximity->reach_m, .grounding = 1.0};
    return proximity_target_change(&ground, thickness + reach) - proximity_target_change(&ground, thickness);
}

/* Tabulate the contribution of an object over u = thickness / (thickness + gap): 0 at the reach and scaled by `share`.
 * The contribution is smooth in u. thickness: of the layer, metres. */
void proximity_prepare(struct proximity_curve *curve, const struct proximity_effect *proximity, double thickness)
{
    curve->thickness = thickness;
    curve->reach = proximity_reach(proximity);
    curve->u_min = thickness / (thickness + curve->reach);
    curve->steps_per_u = PROXIMITY_STEPS / (1.0 - curve->u_min);
    const double far_response = compute_response(proximity, thickness, curve->reach);
    const double scale = compute_scale(proximity, thickness, curve->reach);
    for (int i = 0; i <= PROXIMITY_STEPS; i++) {
        const double gap = thickness / (curve->u_min + i / curve->steps_per_u) - thickness;
        curve->value[i] = proximity->share * (compute_response(proximity, thickness, gap) - far_response) / scale;
    }
}

/* Return the contribution of an object at `gap` (metres) to the relative rise of a cell's fringe capacitance, by linear
 * interpolation in the table; 0 beyond the reach. */
double proximity_rise(const struct proximity_curve *curve, double gap)
{
    if (gap >= curve->reach) {
        return 0.0;
    }
    const double position = (curve->thickness / (curve->thickness + gap) - curve->u_min) * curve->steps_per_u;
    const int index = (int)position;
    if (index >= PROXIMITY_STEPS) {
        return curve->value[PROXIMITY_STEPS];
    }
    return curve->value[index] + (position - index) * (curve->value[index + 1] - curve->value[index]);
}
