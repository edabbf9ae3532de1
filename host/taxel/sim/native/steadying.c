#include "steadying.h"

#include <math.h>
#include <string.h>

#define MOTIONS 6
#define PI 3.14159265358979323846

/* Compute the rotation vector (radians, object frame) from the quaternion `from` to `to`, both unit [w, x, y, z]. */
static void subtract_quaternions(const double *to, const double *from, double turn[3])
{
    const double w = from[0] * to[0] + from[1] * to[1] + from[2] * to[2] + from[3] * to[3];
    const double vector[3] = {
        from[0] * to[1] - from[1] * to[0] - from[2] * to[3] + from[3] * to[2],
        from[0] * to[2] + from[1] * to[3] - from[2] * to[0] - from[3] * to[1],
        from[0] * to[3] - from[1] * to[2] + from[2] * to[1] - from[3] * to[0],
    };
    const double sine = sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    double angle = 2.0 * atan2(sine, w);
    angle -= angle > PI ? 2.0 * PI : 0.0;
    for (size_t k = 0; k < 3; k++) {
        turn[k] = sine > 0.0 ? vector[k] / sine * angle : 0.0;
    }
}

/* Set the Jacobian with which the object's six velocities are converted to the velocity of the centre of mass in the
   world (first three rows) and the angular velocity in the object's frame (last three rows). */
static void set_motion(const double *rotation, const double *centre, double motion[MOTIONS][MOTIONS])
{
    const double cross[3][3] = {
        {0.0, -centre[2], centre[1]}, {centre[2], 0.0, -centre[0]}, {-centre[1], centre[0], 0.0}};
    memset(motion, 0, MOTIONS * MOTIONS * sizeof(double));
    for (size_t i = 0; i < 3; i++) {
        motion[i][i] = motion[3 + i][3 + i] = 1.0;
        for (size_t j = 0; j < 3; j++) {
            for (size_t k = 0; k < 3; k++) {
                motion[i][3 + j] -= rotation[3 * i + k] * cross[k][j];
            }
        }
    }
}

/* Add the experimenter's hand, a damped spring in six directions from the object to its pose at the begin of the hold,
   to the equations of the object's motion. pose: position and quaternion [w, x, y, z] of the object. first: first of
   the object's six degrees of freedom. Directions 0 to 2 are translations, and use stiffness[0] and damping[0]; 3 to 5
   are rotations. No change at a firmness of 0. */
void sim_add_steadying(struct sim_steadying *steadying, const double *pose, const double *rotation, size_t first,
                       struct sim_equations *equations)
{
    if (!(steadying->firmness > 0.0)) {
        return;
    }
    if (!steadying->has_rest) {
        memcpy(steadying->rest, pose, sizeof steadying->rest);
        steadying->has_rest = 1;
    }
    double turn[3], motion[MOTIONS][MOTIONS], deflection[MOTIONS];
    subtract_quaternions(pose + 3, steadying->rest + 3, turn);
    set_motion(rotation, steadying->centre, motion);
    for (size_t k = 0; k < 3; k++) {
        deflection[k] =
            pose[k] - steadying->rest[k] + motion[k][3] * turn[0] + motion[k][4] * turn[1] + motion[k][5] * turn[2];
        deflection[3 + k] = turn[k];
    }
    for (size_t k = 0; k < MOTIONS; k++) {
        const double stiffness = steadying->firmness * steadying->stiffness[k / 3];
        const double rate = equations->step_s * stiffness + steadying->firmness * steadying->damping[k / 3];
        for (size_t i = 0; i < MOTIONS; i++) {
            equations->force[first + i] -= stiffness * deflection[k] * motion[k][i];
            for (size_t j = 0; j < MOTIONS; j++) {
                equations->system[(first + i) * equations->dofs + first + j] += rate * motion[k][i] * motion[k][j];
            }
        }
    }
}
