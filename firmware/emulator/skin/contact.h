/* Contact of one board's skin with an object: geometry in, compression of every cell and the force on the board out. */
#ifndef EMULATOR_SKIN_CONTACT_H
#define EMULATOR_SKIN_CONTACT_H

#include <stdbool.h>

#include "emulator/skin/patch.h"

#define CONTACT_FAR_M 0.05 /* a gap that is not measured any more */

/* On the board, in its bracket's frame, about the frame's origin. */
struct contact_load {
    double wrench[6];       /* force (newtons), moment (newton metres) */
    double stiffness[6][6]; /* how the wrench would answer a small rigid motion, negated: positive semidefinite */
};

/* Is the object farther from every electrode than `reach` (metres) for certain? */
bool contact_is_far(const struct patch *patch, const struct shape *shape, const struct frame *object_of_bracket, double reach);

/* `object_of_bracket` takes bracket coordinates to the object's. compression[cells]: metres, 0 without contact. gap[cells]
 * (may be NULL): from the skin to the object along the normal, CONTACT_FAR_M if farther than `reach` or missed. load may be
 * NULL.
 * `thickness`: of the whole layer over the electrode, metres. Returns whether any cell touches; if the object is farther
 * from the board than that the arrays are cleared without looking at each cell. */
bool contact_press(const struct patch *patch, const struct shape *shape, const struct frame *object_of_bracket,
                   double thickness, double reach, double *compression, double *gap, struct contact_load *load);

#endif
