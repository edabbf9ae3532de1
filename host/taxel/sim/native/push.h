/* One time step of hand and object, which touch only through the elastic layer, linearly implicit in the stiffness of
   layer, stand and steadying hand: taxel.sim.soft_push. */
#ifndef TAXEL_SIM_PUSH_H
#define TAXEL_SIM_PUSH_H

#include <stddef.h>

#include "layer_contact.h"
#include "stand.h"
#include "steadying.h"

/* Arrays of MuJoCo's model and data, which are current when a step begins. */
struct sim_bodies {
    const double *rotation; /* xmat, [bodies][9] */
    const double *position; /* xpos, [bodies][3] */
    const double *centre;   /* subtree_com, [bodies][3] */
    const double *motion;   /* cdof, [dofs][6]: rotation, then translation of a point at the centre of the tree */
    const double *angle;    /* qpos */
    const double *applied;  /* qfrc_applied, [dofs] */
    const double *passive;  /* qfrc_passive, [dofs] */
    const double *bias;     /* qfrc_bias, [dofs] */
    double *velocity;       /* qvel, [dofs]; replaced by the velocity after the step */
    const double *inertia;  /* full matrix, [dofs][dofs] */
};

/* Hinges with dry friction and stiff ends of their ranges. */
struct sim_hinges {
    size_t count;
    const size_t *dof;         /* [count] */
    const size_t *address;     /* [count], index of the angle in qpos */
    const double *min_angle;   /* [count], radians */
    const double *max_angle;   /* [count] */
    double friction_nm;        /* moment at which a hinge slides */
    double presliding_rad;     /* rotation at which it begins to slide */
    double limit_nm_per_rad;   /* stiffness beyond the range */
    double limit_nm_s_per_rad; /* damping beyond the range */
    double *stuck_angle;       /* [count], angle at which the friction vanishes; state */
};

/* The caller owns all memory. */
struct sim_push {
    size_t boards;
    size_t dofs;
    const size_t *board_body; /* [boards] */
    const double *board_pose; /* [boards][SIM_POSE], bracket in the frame of its body */
    const double *dof_sign;   /* [boards][dofs]: 1 moves the board, -1 moves the object, 0 both or none */
    const size_t *dof_root;   /* [dofs], body whose centre is the reference of the motion */
    const double *damping;    /* [dofs] */
    size_t object_body;
    size_t object_dof;     /* first of six: velocity of the origin in the world, angular velocity in its frame */
    size_t object_address; /* first of seven numbers in qpos */
    double step_s;
    double board_radius_m;    /* distance from the bracket's origin at which a rotation is converted to a motion */
    double motion_per_step_m; /* largest motion of a board relative to the object in a step near a contact */
    double max_substeps;
    struct sim_hinges hinges;
    struct sim_stand stand;
    struct sim_steadying steadying;
    struct sim_bodies bodies;
    double *last_wrench; /* [boards][6], of the last step, world; state */
    /* Memory for intermediate results. */
    double *poses;     /* [boards][SIM_POSE] */
    double *jacobian;  /* [boards][6][dofs] */
    double *stiffness; /* [boards][6][6] */
    double *system;    /* [dofs][dofs] */
    double *force;     /* [dofs] */
};

/* Return sizeof (struct sim_push), for a check by a caller in another language. */
size_t sim_push_struct_size(void);

/* Compute the velocities after one substep, and the new state of the contacts. The substep is a fraction of step_s, at
   most `remaining`, chosen so that no board near the object moves too far. Returns the fraction, above 0; or 0 if the
   equations of the substep have no solution. The caller integrates the positions. */
double sim_push_step(struct sim_push *push, struct sim_layer *layer, double remaining);

#endif
