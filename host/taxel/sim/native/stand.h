/* Contact of the object with the plane on which it stands: corner points with a stiff spring and Coulomb friction. */
#ifndef TAXEL_SIM_STAND_H
#define TAXEL_SIM_STAND_H

#include <stddef.h>
#include <stdint.h>

#include "equations.h"

/* The caller owns all memory. A corner sticks to the point of the plane that it first touched, and slides where the
   force along the plane would exceed the friction coefficient times the force across. */
struct sim_stand {
    size_t corners;
    const double *corner; /* [corners][3], object frame, metres */
    double stiffness_n_per_m;
    double friction;     /* coefficient */
    double up[3];        /* unit normal of the plane, world */
    double origin[3];    /* a point of the plane, world, metres */
    double *anchor;      /* [corners][3], point of the plane to which a corner sticks, world; state */
    uint8_t *has_anchor; /* [corners]; state */
};

/* Add the load of the stand on the object to the equations of a step, and store where the corners now stick.
   rotation: [9] by rows, position: [3], both of the object in the world. first: index of the first of the object's six
   degrees of freedom in the equations. */
void sim_add_stand(struct sim_stand *stand, const double *rotation, const double *position, size_t first,
                   struct sim_equations *equations);

#endif
