/* Dry friction and stops of the joints of a hand. */
#ifndef EMULATOR_DYNAMICS_JOINTS_H
#define EMULATOR_DYNAMICS_JOINTS_H

#include <stddef.h>

/* Constants of a joint, the same for all joints. */
struct joint_constants {
    double inertia_kg_m2, damping_nm_s;
    double friction_nm, breakaway_rad; /* the dry friction builds up as a spring over this rotation */
    double stop_nm_per_rad, stop_nm_s_per_rad;
};

/* Range of a joint, and its state. */
struct joint {
    double lower, upper; /* radians */
    double angle, speed; /* radians, radians per second */
    double rest_angle;   /* where the spring of the dry friction is unloaded */
};

/* Return the torque (Nm) of dry friction and stop of a joint, and write its stiffness *rate (Nm/rad). Updates the angle
 * at which the spring of the dry friction is unloaded, so it must be called once per time step. */
double joint_resist(const struct joint_constants *constants, struct joint *joint, double *rate);

#endif
