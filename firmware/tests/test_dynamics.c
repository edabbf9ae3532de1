/* Dynamics of a hand and a free object: equations, object on its stand, joint at its stop. */
#include <math.h>

#include "check.h"
#include "emulator/base/random.h"
#include "emulator/dynamics/free_object.h"
#include "emulator/dynamics/joints.h"
#include "emulator/dynamics/linear_system.h"

#define SEED 3u
#define UNKNOWNS 22
#define VERTICES 4
#define WEIGHT_N 0.981
#define STAND_N_PER_M 25000.0

static const double vertices[VERTICES][3] = {{0.02, 0.02, 0}, {0.02, -0.02, 0}, {-0.02, 0.02, 0}, {-0.02, -0.02, 0}};
static double stuck[VERTICES][3];

/* Return an object of 100 g that stands on four vertices and is not steadied. */
static struct free_object make_object(void)
{
    for (int i = 0; i < VERTICES; i++) {
        stuck[i][0] = NAN;
    }
    return (struct free_object){
        .mass_kg = 0.1,
        .gravity_m_per_s2 = 9.81,
        .centre = {0.0, 0.0, 0.05},
        .inertia = {{1e-4, 0, 0}, {0, 1e-4, 0}, {0, 0, 4e-5}},
        .up = {0.0, 0.0, 1.0},
        .stand_rate = STAND_N_PER_M,
        .stand_friction = 0.4,
        .steadying_rate = {8000.0, 40.0},
        .steadying_damping = {60.0, 0.1},
        .vertex_count = VERTICES,
        .vertices = vertices,
        .stuck = stuck,
        .pose = frame_identity,
        .steadied_pose = frame_identity,
    };
}

/* Random symmetric, positive definite matrices. Only their lower triangle is passed; the upper one is NaN. */
static void the_linear_solver_finds_the_known_solution(void)
{
    struct random_source random;
    random_init(&random, SEED, 0);
    for (int n = 0; n < 20; n++) {
        static double root[UNKNOWNS][UNKNOWNS], matrix[COORDINATES_MAX][COORDINATES_MAX],
            work[COORDINATES_MAX][COORDINATES_MAX];
        double solution[UNKNOWNS], vector[COORDINATES_MAX] = {0.0};
        for (int i = 0; i < UNKNOWNS; i++) {
            solution[i] = random_normal(&random);
            for (int j = 0; j < UNKNOWNS; j++) {
                root[i][j] = random_normal(&random);
            }
        }
        for (int i = 0; i < UNKNOWNS; i++) {
            for (int j = 0; j < UNKNOWNS; j++) {
                matrix[i][j] = i == j ? 1.0 : 0.0;
                for (int k = 0; k < UNKNOWNS; k++) {
                    matrix[i][j] += root[i][k] * root[j][k];
                }
                vector[i] += matrix[i][j] * solution[j];
                work[i][j] = j <= i ? matrix[i][j] : NAN; /* only the lower triangle counts */
            }
        }
        linear_system_solve(work, UNKNOWNS, vector);
        for (int i = 0; i < UNKNOWNS; i++) {
            CHECK(fabs(vector[i] - solution[i]) < 1e-9);
        }
    }
}

static void the_stand_carries_the_weight_of_an_object_that_sinks_in(void)
{
    struct free_object object = make_object();
    double load[OBJECT_DOF], stiffness[OBJECT_DOF][OBJECT_DOF];
    free_object_support(&object, load, stiffness);
    CHECK(fabs(load[2] + WEIGHT_N) < 1e-12);
    const double down[OBJECT_DOF] = {0.0, 0.0, -WEIGHT_N / (VERTICES * STAND_N_PER_M)};
    free_object_move(&object, down, 1.0);
    free_object_support(&object, load, stiffness);
    for (int i = 0; i < OBJECT_DOF; i++) {
        CHECK(fabs(load[i]) < 1e-12);
    }
    CHECK(fabs(stiffness[2][2] / (VERTICES * STAND_N_PER_M) - 1.0) < 1e-12);
}

static void an_object_slides_on_the_stand_at_the_friction_limit(void)
{
    struct free_object object = make_object();
    double load[OBJECT_DOF], stiffness[OBJECT_DOF][OBJECT_DOF];
    const double down[OBJECT_DOF] = {0.0, 0.0, -WEIGHT_N / (VERTICES * STAND_N_PER_M)}, along[OBJECT_DOF] = {1e-3};
    free_object_move(&object, down, 1.0);
    free_object_support(&object, load, stiffness);
    free_object_move(&object, along, 1.0);
    free_object_support(&object, load, stiffness);
    CHECK(fabs(load[0] + 0.4 * WEIGHT_N) < 1e-9);
    CHECK(fabs(stiffness[0][0]) < 1e-6);                 /* no resistance along the sliding */
    CHECK(fabs(load[4] - 0.4 * WEIGHT_N * 0.05) < 1e-4); /* the friction acts 50 mm below the centre of mass */
}

static void the_stiffness_of_the_stand_is_the_negative_derivative_of_its_force(void)
{
    const double step = 1e-7;
    struct free_object start = make_object();
    double load[2][OBJECT_DOF], stiffness[OBJECT_DOF][OBJECT_DOF], ignored[OBJECT_DOF][OBJECT_DOF];
    const double down[OBJECT_DOF] = {0.0, 0.0, -1e-4, 0.0, 0.0, 0.0};
    free_object_move(&start, down, 1.0);
    free_object_support(&start, load[0], stiffness);
    for (int axis = 0; axis < OBJECT_DOF; axis++) {
        for (int side = 0; side < 2; side++) {
            struct free_object object = start;
            double motion[OBJECT_DOF] = {0.0};
            motion[axis] = side ? step : -step;
            free_object_move(&object, motion, 1.0);
            free_object_support(&object, load[side], ignored);
            free_object_support(&start, ignored[0], stiffness); /* the object sticks to its former points again */
        }
        for (int i = 0; i < 3; i++) {
            const double measured = (load[0][i] - load[1][i]) / (2.0 * step);
            CHECK(fabs(measured - stiffness[i][axis]) < 1e-3 * stiffness[2][2]);
        }
    }
}

static void the_experimenter_pulls_an_object_back(void)
{
    struct free_object object = make_object();
    double load[OBJECT_DOF], stiffness[OBJECT_DOF], damping[OBJECT_DOF];
    const double motion[OBJECT_DOF] = {1e-4, -2e-4, 3e-4, 1e-3, 2e-3, -3e-3};
    free_object_steadying(&object, load, stiffness, damping);
    CHECK(load[0] == 0.0 && stiffness[0] == 0.0 && damping[5] == 0.0);
    object.firmness = 0.5;
    free_object_move(&object, motion, 1.0);
    free_object_steadying(&object, load, stiffness, damping);
    for (int i = 0; i < OBJECT_DOF; i++) {
        CHECK(fabs(load[i] + 0.5 * object.steadying_rate[i / 3] * motion[i]) < 1e-3 * fabs(load[i]));
        CHECK(damping[i] == 0.5 * object.steadying_damping[i / 3]);
    }
}

static void a_joint_resists_by_friction_and_at_its_stop(void)
{
    const struct joint_constants constants = {1.5e-3, 0.03, 0.02, 0.0015, 250.0, 1.0};
    struct joint joint = {.lower = -1.0, .upper = 1.0, .angle = 0.001};
    double rate;
    CHECK(fabs(joint_resist(&constants, &joint, &rate) + 0.02 / 1.5) < 1e-12);
    CHECK(fabs(rate - 0.02 / 0.0015) < 1e-9);
    joint.angle = 0.5;
    joint.speed = 1.0;
    CHECK(fabs(joint_resist(&constants, &joint, &rate) + 0.02) < 1e-12);
    CHECK(rate == 0.0); /* a sliding joint has a constant friction */
    CHECK(fabs(joint.rest_angle - (0.5 - 0.0015)) < 1e-12);
    joint.angle = 1.002;
    CHECK(fabs(joint_resist(&constants, &joint, &rate) + 0.02 + 0.5 + 1.0) < 1e-9);
    CHECK(rate == 250.0);
}

int main(void)
{
    printf("seed %u\n", SEED);
    RUN(the_linear_solver_finds_the_known_solution);
    RUN(the_stand_carries_the_weight_of_an_object_that_sinks_in);
    RUN(an_object_slides_on_the_stand_at_the_friction_limit);
    RUN(the_stiffness_of_the_stand_is_the_negative_derivative_of_its_force);
    RUN(the_experimenter_pulls_an_object_back);
    RUN(a_joint_resists_by_friction_and_at_its_stop);
    return check_summary();
}
