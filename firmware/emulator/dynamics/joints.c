#include "emulator/dynamics/joints.h"

#include <math.h>
#include <stdbool.h>

/* Return the torque (Nm) of dry friction and stop of a joint, and write its stiffness *rate (Nm/rad). Updates the angle
 * at which the spring of the dry friction is unloaded. */
double joint_resist(const struct joint_constants *constants, struct joint *joint, double *rate)
{
    const double friction_rate = constants->friction_nm / constants->breakaway_rad;
    /* rotation from the unloaded angle, up to the breakaway angle, at which the friction slides */
    const double bend =
        fmin(fmax(joint->angle - joint->rest_angle, -constants->breakaway_rad), constants->breakaway_rad);
    joint->rest_angle = joint->angle - bend;
    const bool is_sliding = fabs(bend) >= constants->breakaway_rad && bend * joint->speed > 0.0;
    const double beyond = joint->angle - fmin(fmax(joint->angle, joint->lower), joint->upper);
    const double stop = beyond != 0.0 ? constants->stop_nm_per_rad : 0.0;
    const double damping = beyond * joint->speed > 0.0 ? constants->stop_nm_s_per_rad : 0.0;
    *rate = (is_sliding ? 0.0 : friction_rate) + stop;
    return -friction_rate * bend - stop * beyond - damping * joint->speed;
}
