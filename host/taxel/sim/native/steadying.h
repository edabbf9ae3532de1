/* Springs and dampers of the experimenter's hand, which steadies the object at the pose at which it was taken. */
#ifndef TAXEL_SIM_STEADYING_H
#define TAXEL_SIM_STEADYING_H

#include <stddef.h>

#include "equations.h"

struct sim_steadying {
    double firmness;     /* 0: no hold, to 1 */
    double centre[3];    /* centre of mass, object frame, metres; the springs act there */
    double stiffness[2]; /* N/m, Nm/rad */
    double damping[2];   /* Ns/m, Nms/rad */
    int has_rest;        /* 0: the hold begins at the next step; state */
    double rest[7];      /* position (metres) and quaternion of the object when the hold began; state */
};

/* Add the load of the experimenter's hand on the object to the equations of a step; no load at a firmness of 0. In the
   first step of a hold, stores the object's pose as the rest pose. pose: [7], position and quaternion of the object.
   rotation: [9] by rows. first: index of the first of the object's six degrees of freedom in the equations. */
void sim_add_steadying(struct sim_steadying *steadying, const double *pose, const double *rotation, size_t first,
                       struct sim_equations *equations);

#endif
