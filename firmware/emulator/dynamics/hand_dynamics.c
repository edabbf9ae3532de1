#include "emulator/dynamics/hand_dynamics.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "emulator/dynamics/linear_system.h"

#define END_TOLERANCE_S 1e-9 /* shorter remainders of a call are rounding errors */
#define SMALLEST_SPEED_M_PER_S 1e-9

/* Load of a board, in the layout that taxel_contact_evaluate() writes. */
struct board_contact {
    double wrench[6], stiffness[6][6], clearance;
};

/* Values of one time step. */
struct step {
    struct frame brackets[BOARDS_MAX]; /* true poses, world */
    struct board_contact loads[BOARDS_MAX];
    struct bracket_motion motions[BOARDS_MAX];
    double velocity[COORDINATES_MAX], force[COORDINATES_MAX];
    double system[COORDINATES_MAX][COORDINATES_MAX]; /* lower triangle */
    double wrist_speed[3];                           /* m/s, world */
};

/* Evaluate the contact of all boards at the present pose, and the motion of their brackets. */
static void evaluate_contact(struct hand_dynamics *hand, struct step *step)
{
    const struct kinematic_tree *tree = &hand->tree;
    struct frame links[LINKS_MAX], nominal[BOARDS_MAX];
    double angles[JOINTS_MAX], centre[3];
    for (size_t joint = 0; joint < tree->joint_count; joint++) {
        angles[joint] = hand->joints[joint].angle;
        step->velocity[joint] = hand->joints[joint].speed;
    }
    memcpy(&step->velocity[tree->joint_count], hand->object_velocity, sizeof hand->object_velocity);
    kinematics_links(tree, &hand->wrist, angles, links);
    kinematics_brackets(tree, links, nominal);
    hand->touched_count = taxel_contact_evaluate(hand->contact, hand->object_index, &hand->object->pose.row[0][0],
                                                 &nominal[0].row[0][0], step->loads[0].wrench, NULL, 1);
    free_object_centre(hand->object, centre);
    for (size_t board = 0; board < tree->board_count; board++) {
        step->brackets[board] = frame_product(&nominal[board], &tree->mounting[board]);
        kinematics_motion(tree, board, links, &step->brackets[board], centre, &step->motions[board]);
    }
}

/* Return whether a contact puts a load on a board. */
static bool is_loaded(const struct board_contact *load)
{
    bool is_nonzero = false;
    for (int i = 0; i < 6; i++) {
        is_nonzero |= load->wrench[i] != 0.0;
    }
    return is_nonzero;
}

/* Return the length of a vector. */
static double norm(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Return the speed (m/s) of a board relative to the object if it limits the time step: the board is so near that it
 * could touch the object in the step, and does not move away. Otherwise 0. */
static double limiting_speed(const struct hand_dynamics *hand, const struct step *step, size_t board)
{
    const struct bracket_motion *motion = &step->motions[board];
    const struct board_contact *load = &step->loads[board];
    double twist[6] = {0.0}, shift[3], power = 0.0;
    for (size_t n = 0; n < motion->count; n++) {
        for (int i = 0; i < 6; i++) {
            twist[i] += motion->twist[n][i] * step->velocity[motion->coordinate[n]];
        }
    }
    for (int i = 0; i < 6; i++) {
        power += load->wrench[i] * twist[i];
    }
    kinematics_to_bracket(&step->brackets[board], step->wrist_speed, shift);
    for (int k = 0; k < 3; k++) {
        twist[k] += shift[k];
    }
    const double speed = norm(&twist[0]) + hand->limits.board_radius_m * norm(&twist[3]);
    const bool is_near = load->clearance < speed * hand->limits.longest_s + hand->limits.motion_m;
    const bool is_separating = power > 0.0; /* the board moves in the direction in which the contact pushes it */
    return is_near && !is_separating ? speed : 0.0;
}

/* Return the duration (seconds) of the time step, chosen so that no board near the object moves too far. longest:
 * remaining time; the result divides it into equal steps. */
static double choose_duration(const struct hand_dynamics *hand, const struct step *step, double longest)
{
    double speed = SMALLEST_SPEED_M_PER_S;
    for (size_t board = 0; board < hand->tree.board_count; board++) {
        speed = fmax(speed, limiting_speed(hand, step, board));
    }
    const double limit = fmin(hand->touched_count ? hand->limits.longest_s : longest, hand->limits.motion_m / speed);
    /* 1e-9: a quotient that rounding makes slightly larger than a whole number must not add a step. */
    return longest / ceil(longest / fmax(limit, hand->limits.shortest_s) - 1e-9);
}

/* Start the equations of motion, system * velocity = force, with the joints: torques, inertia, damping, friction and
 * stops. The velocity is that at the end of the step. */
static void add_joints(struct hand_dynamics *hand, struct step *step, const double *torque, double dt)
{
    const struct joint_constants *constants = &hand->constants;
    memset(step->system, 0, sizeof step->system);
    for (size_t i = 0; i < hand->tree.joint_count; i++) {
        double rate;
        const double resistance = joint_resist(constants, &hand->joints[i], &rate);
        const double inertia = constants->inertia_kg_m2 / dt;
        step->force[i] = torque[i] + resistance + inertia * step->velocity[i];
        step->system[i][i] = inertia + constants->damping_nm_s + dt * rate;
    }
}

/* Add the object to the equations of motion: inertia, weight, stand and the experimenter's hand. */
static void add_object(struct hand_dynamics *hand, struct step *step, double dt)
{
    const size_t first = hand->tree.joint_count;
    double weight[OBJECT_DOF], support[OBJECT_DOF][OBJECT_DOF], mass[OBJECT_DOF][OBJECT_DOF] = {{0.0}}, inertia[3][3];
    double steadying[OBJECT_DOF], rate[OBJECT_DOF], damping[OBJECT_DOF];
    free_object_support(hand->object, weight, support);
    free_object_steadying(hand->object, steadying, rate, damping);
    free_object_inertia(hand->object, inertia);
    for (int i = 0; i < 3; i++) {
        mass[i][i] = hand->object->mass_kg;
        memcpy(&mass[3 + i][3], inertia[i], sizeof inertia[i]);
    }
    for (size_t i = 0; i < OBJECT_DOF; i++) {
        double momentum = 0.0;
        for (size_t j = 0; j < OBJECT_DOF; j++) {
            momentum += mass[i][j] * step->velocity[first + j];
            step->system[first + i][first + j] += dt * support[i][j] + mass[i][j] / dt;
        }
        step->system[first + i][first + i] += dt * rate[i] + damping[i];
        step->force[first + i] = weight[i] + steadying[i] + momentum / dt;
    }
}

/* Add the contact of one board to the equations of motion: its wrench after the motion of the wrist in this time step,
 * and its stiffness. The system is symmetric and only its lower triangle is used. */
static void add_board(struct step *step, size_t board, double dt)
{
    const struct bracket_motion *motion = &step->motions[board];
    const struct board_contact *load = &step->loads[board];
    double shift[3], wrench[6];
    kinematics_to_bracket(&step->brackets[board], step->wrist_speed, shift);
    for (int i = 0; i < 6; i++) {
        wrench[i] = load->wrench[i];
        for (int k = 0; k < 3; k++) {
            wrench[i] -= load->stiffness[i][k] * dt * shift[k];
        }
    }
    for (size_t n = 0; n < motion->count; n++) {
        const size_t row = motion->coordinate[n];
        double product[6] = {0.0}; /* stiffness times the motion by this coordinate */
        for (int i = 0; i < 6; i++) {
            step->force[row] += motion->twist[n][i] * wrench[i];
            for (int j = 0; j < 6; j++) {
                product[i] += load->stiffness[j][i] * motion->twist[n][j];
            }
        }
        for (size_t m = 0; m < motion->count; m++) {
            const size_t column = motion->coordinate[m];
            for (int i = 0; column <= row && i < 6; i++) {
                step->system[row][column] += dt * product[i] * motion->twist[m][i];
            }
        }
    }
}

/* Move joints and object with the velocity that solves the equations of motion. */
static void move(struct hand_dynamics *hand, struct step *step, double dt)
{
    const size_t joints = hand->tree.joint_count;
    linear_system_solve(step->system, joints + OBJECT_DOF, step->force);
    for (size_t i = 0; i < joints; i++) {
        hand->joints[i].speed = step->force[i];
        hand->joints[i].angle += dt * step->force[i];
    }
    memcpy(hand->object_velocity, &step->force[joints], sizeof hand->object_velocity);
    free_object_move(hand->object, hand->object_velocity, dt);
}

/* Integrate over one time step of at most `longest` seconds. Returns its duration. */
static double advance(struct hand_dynamics *hand, struct step *step, const double *torque, double longest)
{
    evaluate_contact(hand, step);
    const double dt = choose_duration(hand, step, longest);
    add_joints(hand, step, torque, dt);
    add_object(hand, step, dt);
    for (size_t board = 0; board < hand->tree.board_count; board++) {
        if (is_loaded(&step->loads[board])) {
            add_board(step, board, dt);
        }
    }
    move(hand, step, dt);
    return dt;
}

/* Integrate the motion over `duration` seconds in time steps. torque: of the motor of each joint, Nm. The wrist moves
 * at constant speed from its former to its present position. */
void hand_dynamics_step(struct hand_dynamics *hand, const double *torque, double duration)
{
    const struct frame end = hand->wrist;
    struct step step;
    for (int k = 0; k < 3; k++) {
        step.wrist_speed[k] = (end.row[k][3] - hand->wrist_before.row[k][3]) / duration;
    }
    for (double elapsed = 0.0; elapsed < duration - END_TOLERANCE_S;) {
        hand->wrist = end;
        for (int k = 0; k < 3; k++) {
            hand->wrist.row[k][3] -= step.wrist_speed[k] * (duration - elapsed);
        }
        elapsed += advance(hand, &step, torque, duration - elapsed);
    }
    hand->wrist = hand->wrist_before = end;
}
