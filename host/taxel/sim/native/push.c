#include "push.h"

#include <math.h>
#include <string.h>

#define TWIST 6

size_t sim_push_struct_size(void)
{
    return sizeof(struct sim_push);
}

/* Set the pose of each bracket in the world: pose of its body times pose of the bracket on the body. */
static void place_boards(struct sim_push *push)
{
    for (size_t board = 0; board < push->boards; board++) {
        const double *rotation = push->bodies.rotation + 9 * push->board_body[board];
        const double *position = push->bodies.position + 3 * push->board_body[board];
        const double *on_body = push->board_pose + SIM_POSE * board;
        double *pose = push->poses + SIM_POSE * board;
        for (size_t i = 0; i < 3; i++) {
            for (size_t j = 0; j < 4; j++) {
                pose[4 * i + j] = j == 3 ? position[i] : 0.0;
                for (size_t k = 0; k < 3; k++) {
                    pose[4 * i + j] += rotation[3 * i + k] * on_body[4 * k + j];
                }
            }
        }
        memcpy(pose + 12, on_body + 12, 4 * sizeof *pose);
    }
}

/* Set the Jacobian of the motion of each bracket relative to the object: velocity, then angular velocity, world. The
   sign of a degree of freedom is 1 if it moves the board, -1 if it moves the object, 0 for both or none. MuJoCo refers
   the motion of a degree of freedom to the centre of mass of its kinematic tree, where `arm` begins. */
static void set_jacobian(struct sim_push *push)
{
    for (size_t board = 0; board < push->boards; board++) {
        const double *pose = push->poses + SIM_POSE * board, *sign = push->dof_sign + push->dofs * board;
        double *jacobian = push->jacobian + TWIST * push->dofs * board;
        for (size_t dof = 0; dof < push->dofs; dof++) {
            const double *turn = push->bodies.motion + TWIST * dof, *shift = turn + 3;
            const double *centre = push->bodies.centre + 3 * push->dof_root[dof];
            const double arm[3] = {pose[3] - centre[0], pose[7] - centre[1], pose[11] - centre[2]};
            for (size_t k = 0; k < 3; k++) {
                const size_t next = (k + 1) % 3, last = (k + 2) % 3;
                jacobian[k * push->dofs + dof] =
                    sign[dof] * (shift[k] + turn[next] * arm[last] - turn[last] * arm[next]);
                jacobian[(3 + k) * push->dofs + dof] = sign[dof] * turn[k];
            }
        }
    }
}

/* Choose the length of the next substep as a fraction of the time step, at least 1 / max_substeps. Above this minimum,
   no board near the object moves farther than motion_per_step_m, except a board that moves away from the object. */
static double choose_part(const struct sim_push *push, const struct sim_layer *layer)
{
    double fastest = 0.0;
    for (size_t board = 0; board < push->boards; board++) {
        double twist[TWIST] = {0.0}, along = 0.0;
        for (size_t i = 0; i < TWIST; i++) {
            const double *row = push->jacobian + (TWIST * board + i) * push->dofs;
            for (size_t dof = 0; dof < push->dofs; dof++) {
                twist[i] += row[dof] * push->bodies.velocity[dof];
            }
            along += push->last_wrench[TWIST * board + i] * twist[i]; /* power; above 0: the board moves away */
        }
        const double speed =
            sqrt(twist[0] * twist[0] + twist[1] * twist[1] + twist[2] * twist[2]) +
            push->board_radius_m * sqrt(twist[3] * twist[3] + twist[4] * twist[4] + twist[5] * twist[5]);
        const int is_near = layer->clearance_m[board] < speed * push->step_s + push->motion_per_step_m;
        if (is_near && !(along > 0.0) && speed > fastest) {
            fastest = speed;
        }
    }
    const double parts = ceil(fastest * push->step_s / push->motion_per_step_m);
    return 1.0 / (parts < 1.0 ? 1.0 : parts > push->max_substeps ? push->max_substeps : parts);
}

/* Set the equations of a step to inertia, damping and the forces of joints and motors. */
static void set_motion_equations(const struct sim_push *push, struct sim_equations *equations)
{
    const struct sim_bodies *bodies = &push->bodies;
    for (size_t i = 0; i < push->dofs; i++) {
        double momentum = 0.0;
        for (size_t j = 0; j < push->dofs; j++) {
            const double inertia = bodies->inertia[i * push->dofs + j];
            equations->system[i * push->dofs + j] = inertia / equations->step_s;
            momentum += inertia * bodies->velocity[j];
        }
        equations->system[i * push->dofs + i] += push->damping[i];
        equations->force[i] = bodies->applied[i] + bodies->passive[i] - bodies->bias[i] + momentum / equations->step_s;
    }
}

/* Add dry friction and range limits of the hinges to the equations. Dry friction is a spring to the angle at which the
   hinge came to rest, with a limited moment (Dahl 1968); beyond its range a hinge meets a stiff, damped spring. */
static void add_hinges(const struct sim_push *push, struct sim_equations *equations)
{
    const struct sim_hinges *hinges = &push->hinges;
    const double stiffness = hinges->friction_nm / hinges->presliding_rad;
    for (size_t hinge = 0; hinge < hinges->count; hinge++) {
        const size_t dof = hinges->dof[hinge];
        const double angle = push->bodies.angle[hinges->address[hinge]], largest = hinges->presliding_rad;
        const double excess = angle - fmin(fmax(angle, hinges->min_angle[hinge]), hinges->max_angle[hinge]);
        const double deflection = fmin(fmax(angle - hinges->stuck_angle[hinge], -largest), largest);
        const int slides = fabs(deflection) >= largest && deflection * push->bodies.velocity[dof] > 0.0;
        double *diagonal = &equations->system[dof * (push->dofs + 1)];
        hinges->stuck_angle[hinge] = angle - deflection;
        equations->force[dof] -= stiffness * deflection + hinges->limit_nm_per_rad * excess;
        *diagonal += slides ? 0.0 : equations->step_s * stiffness;
        *diagonal += excess != 0.0 ? equations->step_s * hinges->limit_nm_per_rad + hinges->limit_nm_s_per_rad : 0.0;
    }
}

/* Add wrench and stiffness of the layer on one board with the Jacobian J of its motion: J^T w and step J^T K J. */
static void add_board(const struct sim_push *push, size_t board, struct sim_equations *equations)
{
    const size_t n = push->dofs;
    const double *jacobian = push->jacobian + TWIST * n * board, *wrench = push->last_wrench + TWIST * board;
    const double *stiffness = push->stiffness + TWIST * TWIST * board;
    for (size_t i = 0; i < n; i++) {
        double turned[TWIST] = {0.0}; /* a row of step J^T K */
        if (push->dof_sign[n * board + i] == 0.0) {
            continue;
        }
        for (size_t k = 0; k < TWIST; k++) {
            const double part = jacobian[k * n + i];
            equations->force[i] += part * wrench[k];
            for (size_t j = 0; j < TWIST; j++) {
                turned[j] += equations->step_s * part * stiffness[TWIST * k + j];
            }
        }
        for (size_t k = 0; k < TWIST; k++) {
            for (size_t j = 0; j < n; j++) {
                equations->system[i * n + j] += turned[k] * jacobian[k * n + j];
            }
        }
    }
}

/* Return whether the layer loads a board: any component of its wrench differs from 0. */
static int is_loaded(const double *wrench)
{
    for (size_t i = 0; i < TWIST; i++) {
        if (wrench[i] != 0.0) {
            return 1;
        }
    }
    return 0;
}

/* Compute the layer's contact at the present poses; stores the wrenches in last_wrench, and the stiffness. */
static void load_layer(struct sim_push *push, struct sim_layer *layer)
{
    const double *rotation = push->bodies.rotation + 9 * push->object_body;
    const double *position = push->bodies.position + 3 * push->object_body;
    double pose[SIM_POSE] = {0.0};
    for (size_t i = 0; i < 3; i++) {
        memcpy(pose + 4 * i, rotation + 3 * i, 3 * sizeof *pose);
        pose[4 * i + 3] = position[i];
    }
    pose[15] = 1.0;
    sim_layer_load(layer, push->poses, pose, push->last_wrench, push->stiffness, NULL, 1);
}

/* Compute the velocities after one substep, implicit in the stiffness of all contacts. Returns the length of the
   substep as a fraction of step_s, at most `remaining`; 0 if the equations have no solution. The caller integrates the
   positions. */
double sim_push_step(struct sim_push *push, struct sim_layer *layer, double remaining)
{
    place_boards(push);
    set_jacobian(push);
    const double part = fmin(choose_part(push, layer), remaining);
    struct sim_equations equations = {push->dofs, part * push->step_s, push->system, push->force};
    load_layer(push, layer);
    set_motion_equations(push, &equations);
    add_hinges(push, &equations);
    for (size_t board = 0; board < push->boards; board++) {
        if (is_loaded(push->last_wrench + TWIST * board)) {
            add_board(push, board, &equations);
        }
    }
    const double *rotation = push->bodies.rotation + 9 * push->object_body;
    sim_add_stand(&push->stand, rotation, push->bodies.position + 3 * push->object_body, push->object_dof, &equations);
    sim_add_steadying(&push->steadying, push->bodies.angle + push->object_address, rotation, push->object_dof,
                      &equations);
    if (!sim_solve(&equations)) {
        return 0.0;
    }
    memcpy(push->bodies.velocity, equations.force, push->dofs * sizeof(double));
    return part;
}
