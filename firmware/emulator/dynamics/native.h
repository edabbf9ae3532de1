/* C interface of the dynamics in libtaxel_contact, for a caller that fills in `struct hand_dynamics` and `struct
 * free_object`.
 *
 * Integration:
 *
 *     struct hand_dynamics hand = {...};
 *     taxel_dynamics_step(&hand, torque, 0.003); // seconds
 *     use_angle(hand.joints[0].angle);
 */
#ifndef EMULATOR_DYNAMICS_NATIVE_H
#define EMULATOR_DYNAMICS_NATIVE_H

#include <stddef.h>

#include "emulator/dynamics/hand_dynamics.h"

/* Write the sizes of the structures in bytes and the largest numbers of links, joints and boards, for the checks of a
 * caller in another language. */
void taxel_dynamics_sizes(size_t sizes[5]);

/* Integrate the motion of hand and object over `duration` seconds. torque[joints]: of the motors, Nm. */
void taxel_dynamics_step(struct hand_dynamics *hand, const double *torque, double duration);

/* Write the nominal poses of the brackets in the world: poses[boards][12], 3 rows of 4 each. */
void taxel_dynamics_brackets(const struct hand_dynamics *hand, double *poses);

/* Write the sum of weight and force of the stand, load[6], and the stiffness of the stand, stiffness[6][6]. Updates
 * where the vertices stick. */
void taxel_dynamics_support(struct free_object *object, double *load, double *stiffness);

/* Write the force of the experimenter's hand, its stiffness and its damping, each [6]. */
void taxel_dynamics_steadying(const struct free_object *object, double *load, double *stiffness, double *damping);

/* Move an object for `duration` seconds. velocity[6]: of the centre of mass (m/s), and angular (rad/s). */
void taxel_dynamics_move(struct free_object *object, const double *velocity, double duration);

#endif
