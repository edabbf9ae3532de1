/* Object of a grasp: a free rigid body under gravity that stands on a plane with dry friction, and that an experimenter
 * may steady.
 *
 * Coordinates of the motion: the centre of mass, and the rotation, both in world coordinates. The points of the object
 * that touch the stand are its vertices. Each vertex is a spring across the plane, sticks to the plane, and slides
 * where the force along the plane exceeds the friction coefficient times the force across it. */
#ifndef EMULATOR_DYNAMICS_FREE_OBJECT_H
#define EMULATOR_DYNAMICS_FREE_OBJECT_H

#include <stddef.h>

#include "emulator/geometry/frame.h"

#define OBJECT_DOF 6

/* Constants and state of an object. The caller fills in all values; the functions of this header change only the
 * state. */
struct free_object {
    double mass_kg, gravity_m_per_s2;
    double centre[3];                               /* of mass, object frame, metres */
    double inertia[3][3];                           /* about the centre of mass, object frame, kg m2 */
    double up[3], level;                            /* plane of the stand: up . p = level, metres */
    double stand_rate, stand_friction;              /* stiffness at one vertex (N/m), friction coefficient */
    double steadying_rate[2], steadying_damping[2]; /* of the experimenter's hand: N/m, Nm/rad; Ns/m, Nms/rad */
    size_t vertex_count;
    const double (*vertices)[3]; /* [vertex_count], object frame, metres */

    /* State */
    double (*stuck)[3];               /* [vertex_count], point where a vertex sticks to the stand; NaN: no contact */
    struct frame pose, steadied_pose; /* world; the latter is the pose in which the experimenter took hold */
    double firmness;                  /* of the experimenter's hold, 0 to 1 */
};

/* Compute the centre of mass in the world, metres. */
void free_object_centre(const struct free_object *object, double centre[3]);

/* Compute the inertia about the centre of mass in world coordinates, kg m2. */
void free_object_inertia(const struct free_object *object, double inertia[3][3]);

/* Compute the sum of weight and forces of the stand (load: N, and Nm about the centre of mass), and the stiffness of
 * the stand. Updates where each vertex sticks to the stand, so it must be called once per time step. */
void free_object_support(struct free_object *object, double load[OBJECT_DOF], double stiffness[OBJECT_DOF][OBJECT_DOF]);

/* Compute the force of the experimenter's hand that steadies the object (load: N, and Nm about the centre of mass), and
 * the stiffness and damping of this hold, one value per coordinate. */
void free_object_steadying(const struct free_object *object, double load[OBJECT_DOF], double stiffness[OBJECT_DOF],
                           double damping[OBJECT_DOF]);

/* Move the object for `dt` seconds. velocity: of the centre of mass (m/s), and angular (rad/s). */
void free_object_move(struct free_object *object, const double velocity[OBJECT_DOF], double dt);

#endif
