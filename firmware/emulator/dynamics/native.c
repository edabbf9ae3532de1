#include "emulator/dynamics/native.h"

#include <string.h>

/* Write the sizes of the structures (bytes), with which a caller in another language checks its own definitions, and
 * the largest numbers of links, joints and boards. */
void taxel_dynamics_sizes(size_t sizes[5])
{
    sizes[0] = sizeof(struct hand_dynamics);
    sizes[1] = sizeof(struct free_object);
    sizes[2] = LINKS_MAX;
    sizes[3] = JOINTS_MAX;
    sizes[4] = BOARDS_MAX;
}

/* Integrate the motion of hand and object over `duration` seconds under motor torques (Nm). */
void taxel_dynamics_step(struct hand_dynamics *hand, const double *torque, double duration)
{
    hand_dynamics_step(hand, torque, duration);
}

/* Write the nominal poses (without mounting errors) of all brackets, the mounts of the boards, in the world: 3 rows of
 * 4 numbers each. */
void taxel_dynamics_brackets(const struct hand_dynamics *hand, double *poses)
{
    struct frame links[LINKS_MAX], brackets[BOARDS_MAX];
    double angles[JOINTS_MAX];
    for (size_t joint = 0; joint < hand->tree.joint_count; joint++) {
        angles[joint] = hand->joints[joint].angle;
    }
    kinematics_links(&hand->tree, &hand->wrist, angles, links);
    kinematics_brackets(&hand->tree, links, brackets);
    memcpy(poses, brackets, hand->tree.board_count * sizeof brackets[0]);
}

/* Write the sum of weight and force of the stand (load[6]: N, and Nm about the centre of mass), and the stiffness of
 * the stand, stiffness[6][6]. */
void taxel_dynamics_support(struct free_object *object, double *load, double *stiffness)
{
    double matrix[OBJECT_DOF][OBJECT_DOF];
    free_object_support(object, load, matrix);
    memcpy(stiffness, matrix, sizeof matrix);
}

/* Write the force of the experimenter's hand (load: N, and Nm about the centre of mass), its stiffness and its damping,
 * each [6]. */
void taxel_dynamics_steadying(const struct free_object *object, double *load, double *stiffness, double *damping)
{
    free_object_steadying(object, load, stiffness, damping);
}

/* Move an object for `duration` seconds. velocity[6]: of the centre of mass (m/s), and angular (rad/s). */
void taxel_dynamics_move(struct free_object *object, const double *velocity, double duration)
{
    free_object_move(object, velocity, duration);
}
