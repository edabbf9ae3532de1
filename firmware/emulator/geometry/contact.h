/* Contact of one board's skin with an object: from geometry to the compression of every cell and the force on the
 * board. */
#ifndef EMULATOR_GEOMETRY_CONTACT_H
#define EMULATOR_GEOMETRY_CONTACT_H

#include <stdbool.h>

#include "emulator/geometry/patch.h"

#define CONTACT_FAR_M 0.05 /* larger gaps are not computed */

/* Load on a board in its bracket's frame, about the origin of that frame. */
struct contact_load {
    double wrench[6]; /* force (newtons), moment (newton metres) */
    /* negative derivative of the wrench with respect to a small rigid motion: positive semidefinite */
    double stiffness[6][6];
    double clearance; /* lower bound of the distance from the skin to the object, metres; 0: the skin may touch */
};

/* Adhesion of the skin of one board to an object: a cell sticks to the point of the object that it first touches, is
 * sheared, and slides where the shear force exceeds the friction coefficient times the normal force. The caller owns
 * the arrays, and clears `sticks` before the first contact. */
struct contact_grip {
    double coefficient; /* friction coefficient */
    bool advances;      /* whether contact_solve() updates the points; else it only uses them */
    double *stuck;      /* [cells + margin cells], share of the area of the cell that sticks or slides; 0: no contact */
    double (*point)[3]; /* [cells + margin cells], object frame, metres */
    /* Squares that are far from the object are examined again only after the board has moved as far. */
    bool has_frame;     /* false: the following values are not valid yet */
    struct frame frame; /* bracket in the object's frame at the last call */
    double travel;      /* bound of the motion of any cell since the first call, metres */
    double *due;        /* [taxels + margins], travel at which a square may touch the object */
    double skin_travel; /* as `travel`, for the surface of the unloaded layer */
    double
        *untouched; /* [taxels + margins], skin travel at which a cell of a square may touch the object; may be NULL */
};

/* Whether the object is certainly farther from every electrode than `reach` (metres). */
bool contact_is_far(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                    double reach);

/* Solve the contact of a board. Returns whether a cell touches the object. If the object is certainly farther away than
 * thickness + reach, the arrays are cleared without examining each cell.
 *
 * object_from_bracket: transform from bracket to object coordinates. compression[cells] (may be NULL): metres, 0 without contact; that
 * of a cell which the object covers partly gives the mean pressure on the cell.
 * gap[cells] (may be NULL): distance from the skin to the object along the normal; CONTACT_FAR_M beyond `reach` or if
 * the normal misses the object. load may be NULL. grip: NULL: cells are not sheared, and each is a spring
 * along its normal. thickness: layer above the electrode, metres. */
bool contact_solve(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                   double thickness, double reach, double *compression, double *gap, struct contact_load *load,
                   struct contact_grip *grip);

#endif
