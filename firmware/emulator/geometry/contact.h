/* Contact of one board's skin with an object: from geometry to the compression of every cell and the force on the
 * board.
 *
 * Terms: a square is the skin above one taxel, or a margin (bare sheet beside the taxels), and consists of 4 x 4 cells.
 * A face is a flat side of a polyhedron, or the wall or a cap of a cylinder. */
#ifndef EMULATOR_GEOMETRY_CONTACT_H
#define EMULATOR_GEOMETRY_CONTACT_H

#include <stdbool.h>

#include "emulator/geometry/patch.h"

#define CONTACT_FAR_M 0.05 /* larger gaps are not computed */

/* Load of an object on a board in the frame of the board's bracket; moments act about the origin of this frame. */
struct contact_load {
    double wrench[6]; /* force (newtons), moment (newton metres) */
    /* negative derivative of the wrench with respect to a small rigid motion: positive semidefinite */
    double stiffness[6][6];
    double clearance; /* lower bound of the distance from the skin to the object, metres; 0: the skin may touch */
};

/* Friction between the skin of one board and an object. A cell sticks to the point of the object that it first touches,
 * is sheared by motion along the surface, and slides where the shear force exceeds the friction coefficient times the
 * normal force. The caller owns the arrays, and clears `stuck` before the first contact. Arrays begin with the taxels
 * (or their cells); the margins follow. */
struct contact_grip {
    double coefficient; /* friction coefficient */
    bool advances;      /* whether contact_solve() updates `stuck` and `point`; otherwise it only reads them */
    double *stuck;      /* [cells + margin cells], share of the area of the cell that sticks or slides; 0: no contact */
    double (*point)[3]; /* [cells + margin cells], where each cell sticks to the object; object frame, metres */
    /* A square that is far from the object is examined again only after the board has moved by the distance of the
     * square from the object. `travel` measures this motion. */
    bool has_frame;     /* false: the following values are not valid yet */
    struct frame frame; /* transform from bracket to object coordinates at the last call */
    double travel;      /* bound of the motion of any cell since the first call, metres */
    double *due;        /* [taxels + margins], travel at which a square may touch the object */
    double skin_travel; /* as `travel`, for the surface of the unloaded layer */
    double
        *untouched; /* [taxels + margins], skin travel at which a cell of a square may touch the object; may be NULL */
};

/* Return whether the object is certainly farther than `reach` (metres) from every electrode of the board. False does
 * not imply a contact. */
bool contact_is_far(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                    double reach);

/* Solve the contact of a board's skin with an object. Returns whether a cell touches the object. If the object is
 * certainly farther than thickness + reach from the electrodes, the arrays are cleared without examining each cell.
 *
 * object_from_bracket: transform from bracket to object coordinates. thickness: layer above the electrode, metres.
 * compression[cells]: result in metres, 0 without contact; a cell that the object covers only partly gets the
 * compression that corresponds to its mean pressure. gap[cells]: result, distance in metres from the skin to the object
 * along the normal; CONTACT_FAR_M beyond `reach` or if the normal misses the object. load: result for the whole board.
 * grip: friction; if NULL, cells are not sheared, and each cell is a spring along its normal. compression, gap, load
 * and grip may be NULL. */
bool contact_solve(const struct patch *patch, const struct shape *shape, const struct frame *object_from_bracket,
                   double thickness, double reach, double *compression, double *gap, struct contact_load *load,
                   struct contact_grip *grip);

#endif
