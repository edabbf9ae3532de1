/* Joint dynamics of a hand with a prescribed wrist, in contact with a free object.
 *
 * Joints and object are integrated together: M x'' + B x' = torque + contact(x), with diagonal M and B of the joints.
 * Each step is linearly implicit (Rosenbrock-Euler): with the stiffness K of all contacts at the start of the step,
 * (M / dt + B + dt K) v' = M v / dt + torque + contact. The step is stable for any stiffness of the layer. */
#ifndef EMULATOR_DYNAMICS_HAND_DYNAMICS_H
#define EMULATOR_DYNAMICS_HAND_DYNAMICS_H

#include <stdint.h>

#include "emulator/dynamics/free_object.h"
#include "emulator/dynamics/joints.h"
#include "emulator/dynamics/kinematics.h"
#include "emulator/skin/native.h"

/* Limits of a time step. */
struct step_limits {
    double longest_s, shortest_s; /* largest step in contact, smallest step */
    double motion_m;              /* largest motion of a board relative to an object that the board may touch */
    double board_radius_m;        /* distance from the bracket's origin within which a rotation counts as a motion */
};

/* A hand and its object. The caller fills in all values, and owns the arrays. */
struct hand_dynamics {
    struct kinematic_tree tree;
    struct joint_constants constants;
    struct step_limits limits;
    struct taxel_contact *contact;
    int32_t object_index; /* of the object in the world file of the contact; -1: no object */
    struct free_object *object;

    /* State */
    int32_t touched_count;            /* boards in contact in the last step */
    struct joint *joints;             /* [joint_count] */
    double object_velocity[6];        /* of the centre of mass (m/s), angular (rad/s) */
    struct frame wrist, wrist_before; /* world; the wrist moves from the latter to the former in the next call */
};

/* Integrate the motion over `duration` seconds. torque[joint_count]: of the motors, Nm. */
void hand_dynamics_step(struct hand_dynamics *hand, const double *torque, double duration);

#endif
