#include "emulator/effects/proximity.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/physics/layer.h"
#include "emulator/geometry/contact.h"

#define IMAGE_FAR 5.0 /* in units of the electrode distance */

/* Read a world-file line `effect proximity`: the response to an object that does not touch yet (`share` of the fringe
 * capacitance) and the distance in metres over which it decays. Returns 0, or -1 after an error line on stderr. */
int proximity_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[PROXIMITY_IMAGE] = "image", [PROXIMITY_WEDGE] = "wedge", NULL};
    const int form = effect_line_form_index(line, forms);
    effects->proximity = (struct proximity_effect){.form = form == PROXIMITY_WEDGE ? PROXIMITY_WEDGE : PROXIMITY_IMAGE};
    return form < 0 || effect_line_number(line, "share", 0.0, 1.0, &effects->proximity.share) ||
                   effect_line_number(line, "reach_m", 1e-5, 0.02, &effects->proximity.reach_m)
               ? -1
               : 0;
}

/* True if the world file has an effect "proximity" (signal before contact) with a share above 0. */
bool proximity_is_on(const struct proximity_effect *proximity)
{
    return proximity->share != 0.0;
}

/* Smallest gap (metres) at which an object has no influence; 0 if the effect is inactive. */
double proximity_reach(const struct proximity_effect *proximity)
{
    const double reach = proximity->form == PROXIMITY_IMAGE ? IMAGE_FAR * proximity->reach_m : proximity->reach_m;
    return proximity_is_on(proximity) ? fmin(reach, CONTACT_FAR_M) : 0.0;
}

/* Response to an object at a gap, without normalisation: `image` has the flux of two line electrodes through the face
 * of the object; `wedge` has the series capacitance of an air film and the layer. */
static double compute_response(const struct proximity_effect *proximity, double thickness, double gap)
{
    const double ratio = 0.5 * proximity->reach_m / (thickness + gap);
    return proximity->form == PROXIMITY_IMAGE ? log1p(ratio * ratio)
                                              : 1.0 / (1.0 + layer_rest_permittivity() * gap / thickness);
}

/* Tabulate the contribution of an object over u = thickness / (thickness + gap), normalised to `share` in contact and 0
 * at the reach; the contribution is smooth in u. `thickness`: of the layer, metres. */
void proximity_prepare(struct proximity_curve *curve, const struct proximity_effect *proximity, double thickness)
{
    curve->thickness = thickness;
    curve->reach = proximity_reach(proximity);
    curve->u_min = thickness / (thickness + curve->reach);
    curve->steps_per_u = PROXIMITY_STEPS / (1.0 - curve->u_min);
    const double far_response = compute_response(proximity, thickness, curve->reach);
    const double range = compute_response(proximity, thickness, 0.0) - far_response;
    for (int i = 0; i <= PROXIMITY_STEPS; i++) {
        const double gap = thickness / (curve->u_min + i / curve->steps_per_u) - thickness;
        curve->value[i] = proximity->share * (compute_response(proximity, thickness, gap) - far_response) / range;
    }
}

/* Contribution of an object at `gap` (metres) to the relative rise of the permittivity of a cell, by linear
 * interpolation in the table. */
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
