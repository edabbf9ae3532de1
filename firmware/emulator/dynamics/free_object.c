#include "emulator/dynamics/free_object.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "emulator/geometry/vector.h"

#define SMALLEST_SLIP_M 1e-12 /* a shorter slip has no direction */

/* Compute the centre of mass of an object in the world (metres). */
void free_object_centre(const struct free_object *object, double centre[3])
{
    frame_point(&object->pose, object->centre, centre);
}

/* Compute the inertia of an object about its centre of mass in world coordinates (kg m2): R I R^T. */
void free_object_inertia(const struct free_object *object, double inertia[3][3])
{
    double half[3][3]; /* R I */
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double column[3] = {object->inertia[0][j], object->inertia[1][j], object->inertia[2][j]};
            half[i][j] = dot(object->pose.row[i], column);
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            inertia[i][j] = dot(half[i], object->pose.row[j]);
        }
    }
}

/* Spring of the stand in one vertex. */
struct support {
    double force[3], spring[3][3]; /* N, N/m */
};

/* Return force and stiffness of the stand at vertex number `vertex`, which lies at `point`, `depth` metres below the
 * plane of the stand. Updates the point where the vertex sticks: at the first contact (old point NaN) it sticks at
 * `point`; beyond the friction limit it slides. `share` is the part of the slip that friction holds, 1 while the vertex
 * sticks. */
static struct support press_vertex(struct free_object *object, size_t vertex, const double point[3], double depth)
{
    const double *up = object->up;
    double *stuck = object->stuck[vertex], slip[3] = {0.0, 0.0, 0.0};
    if (!isnan(stuck[0])) {
        for (int k = 0; k < 3; k++) {
            slip[k] = point[k] - stuck[k];
        }
        const double across = dot(slip, up);
        for (int k = 0; k < 3; k++) {
            slip[k] -= across * up[k];
        }
    }
    const double distance = sqrt(dot(slip, slip)), length = fmax(distance, SMALLEST_SLIP_M);
    /* depth and slip have the same spring rate, so friction holds a slip of at most stand_friction * depth */
    const double share = fmin(1.0, object->stand_friction * depth / length);
    struct support support;
    for (int i = 0; i < 3; i++) {
        stuck[i] = point[i] - share * slip[i];
        support.force[i] = object->stand_rate * (depth * up[i] - share * slip[i]);
        for (int j = 0; j < 3; j++) {
            /* a spring across and along the plane; sliding adds no force in its direction */
            const double sliding = share < 1.0 ? share * slip[i] * slip[j] / (length * length) : 0.0;
            const double spring = up[i] * up[j] + share * ((i == j) - up[i] * up[j]) - sliding;
            support.spring[i][j] = object->stand_rate * spring;
        }
    }
    return support;
}

/* Add a force and a spring at `arm` (metres from the centre of mass, world coordinates) to the load and the stiffness
 * of the object. */
static void add_support(const struct support *support, const double arm[3], double load[OBJECT_DOF],
                        double stiffness[OBJECT_DOF][OBJECT_DOF])
{
    double moment[3], product[3][3]; /* [arm] S */
    cross(arm, support->force, moment);
    for (int j = 0; j < 3; j++) {
        const double column[3] = {support->spring[0][j], support->spring[1][j], support->spring[2][j]};
        double turned[3];
        cross(arm, column, turned);
        for (int i = 0; i < 3; i++) {
            product[i][j] = turned[i];
        }
    }
    for (int i = 0; i < 3; i++) {
        double turned[3]; /* row of [arm] S [arm]^T */
        cross(arm, product[i], turned);
        load[i] += support->force[i];
        load[3 + i] += moment[i];
        for (int j = 0; j < 3; j++) {
            stiffness[i][j] += support->spring[i][j];
            stiffness[3 + i][j] += product[i][j];
            stiffness[j][3 + i] += product[i][j];
            stiffness[3 + i][3 + j] += turned[j];
        }
    }
}

/* Compute the sum of weight (along -z of the world) and forces of the stand at all vertices (load: N, and Nm about the
 * centre of mass), with the stiffness of the stand. Updates the points where the vertices stick. */
void free_object_support(struct free_object *object, double load[OBJECT_DOF], double stiffness[OBJECT_DOF][OBJECT_DOF])
{
    double centre[3];
    memset(load, 0, OBJECT_DOF * sizeof load[0]);
    memset(stiffness, 0, OBJECT_DOF * sizeof stiffness[0]);
    free_object_centre(object, centre);
    load[2] = -object->mass_kg * object->gravity_m_per_s2;
    for (size_t vertex = 0; vertex < object->vertex_count; vertex++) {
        double point[3], arm[3];
        frame_point(&object->pose, object->vertices[vertex], point);
        const double depth = object->level - dot(point, object->up);
        if (depth <= 0.0) {
            object->stuck[vertex][0] = NAN;
            continue;
        }
        for (int k = 0; k < 3; k++) {
            arm[k] = point[k] - centre[k];
        }
        const struct support support = press_vertex(object, vertex, point, depth);
        add_support(&support, arm, load, stiffness);
    }
}

/* Compute force, stiffness and damping of the experimenter's hand, which are proportional to the firmness of the hold.
 * The force draws the object back to the pose in which the experimenter took hold; all are 0 without a hold.
 * Coordinates 0 to 2 are translations (load in N), 3 to 5 rotations about the centre of mass (load in Nm). */
void free_object_steadying(const struct free_object *object, double load[OBJECT_DOF], double stiffness[OBJECT_DOF],
                           double damping[OBJECT_DOF])
{
    double centre[3], arm[3], shift[3], motion[OBJECT_DOF];
    for (int i = 0; i < OBJECT_DOF; i++) {
        stiffness[i] = object->firmness * object->steadying_rate[i / 3];
        damping[i] = object->firmness * object->steadying_damping[i / 3];
        load[i] = 0.0;
    }
    if (object->firmness == 0.0) {
        return;
    }
    const struct frame from_hold = frame_inverse(&object->steadied_pose);
    const struct frame turn = frame_product(&object->pose, &from_hold);
    frame_rotation_vector(&turn, &motion[3]);
    free_object_centre(object, centre);
    for (int k = 0; k < 3; k++) {
        arm[k] = object->pose.row[k][3] - centre[k];
    }
    cross(&motion[3], arm, shift); /* of the origin by the rotation about the centre of mass */
    for (int k = 0; k < 3; k++) {
        motion[k] = object->pose.row[k][3] - object->steadied_pose.row[k][3] - shift[k];
    }
    for (int i = 0; i < OBJECT_DOF; i++) {
        load[i] = -stiffness[i] * motion[i];
    }
}

/* Move the centre of mass and rotate the object about it, at constant velocity for `dt` seconds. velocity: m/s, then
 * rad/s. */
void free_object_move(struct free_object *object, const double velocity[OBJECT_DOF], double dt)
{
    const double shift[3] = {dt * velocity[0], dt * velocity[1], dt * velocity[2]};
    const double turn[3] = {dt * velocity[3], dt * velocity[4], dt * velocity[5]};
    const double nothing[3] = {0.0, 0.0, 0.0};
    double centre[3], turned[3];
    free_object_centre(object, centre);
    const struct frame rotation = frame_of_offset(nothing, turn);
    object->pose = frame_product(&rotation, &object->pose);
    frame_direction(&object->pose, object->centre, turned);
    for (int k = 0; k < 3; k++) {
        object->pose.row[k][3] = centre[k] + shift[k] - turned[k];
    }
}
