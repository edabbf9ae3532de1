#include "stand.h"

#include <math.h>

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Set the velocity (world) of a point of the object per unit of the object's six velocities: velocity of its origin in
   the world, and angular velocity in its own frame. arm: from the origin to the point, world. */
static void set_motion(const double *rotation, const double arm[3], double motion[6][3])
{
    for (size_t i = 0; i < 3; i++) {
        const double axis[3] = {rotation[i], rotation[3 + i], rotation[6 + i]}; /* axis i of the object in the world */
        for (size_t j = 0; j < 3; j++) {
            motion[i][j] = i == j ? 1.0 : 0.0;
            motion[3 + i][j] = axis[(j + 1) % 3] * arm[(j + 2) % 3] - axis[(j + 2) % 3] * arm[(j + 1) % 3];
        }
    }
}

/* Compute the shear (metres) of a corner along the plane, from its anchor to its present position `point`; 0 without an
   anchor. Returns its length. */
static double find_shear(const struct sim_stand *stand, size_t corner, const double point[3], double shear[3])
{
    for (size_t k = 0; k < 3; k++) {
        shear[k] = stand->has_anchor[corner] ? point[k] - stand->anchor[3 * corner + k] : 0.0;
    }
    const double across = dot(shear, stand->up);
    for (size_t k = 0; k < 3; k++) {
        shear[k] -= across * stand->up[k];
    }
    return sqrt(dot(shear, shear));
}

/* Compute force and stiffness of a corner that is `depth` metres below the plane, and store where it now sticks. */
static void press_corner(struct sim_stand *stand, size_t corner, const double point[3], double depth, double force[3],
                         double stiffness[3][3])
{
    const double k_n = stand->stiffness_n_per_m, *up = stand->up;
    double shear[3];
    /* The spring has the stiffness k_n both perpendicular to the plane and along it, so that the corner slides at a
       shear of friction * depth. */
    const double length = find_shear(stand, corner, point, shear), limit = stand->friction * depth;
    const int slides = length > limit;
    const double rate = slides ? k_n * limit / length : k_n;
    for (size_t i = 0; i < 3; i++) {
        force[i] = k_n * depth * up[i] - rate * shear[i];
        stand->anchor[3 * corner + i] = point[i] - shear[i] * (rate / k_n);
        for (size_t j = 0; j < 3; j++) {
            /* A sliding corner resists only motion across its direction of sliding. */
            const double slip = slides ? rate * shear[i] * shear[j] / (length * length) : 0.0;
            stiffness[i][j] = (k_n - rate) * up[i] * up[j] + (i == j ? rate : 0.0) - slip;
        }
    }
    stand->has_anchor[corner] = 1;
}

/* Add force and stiffness of the stand at all corners below its plane to the equations of the object's motion; see
   stand.h. */
void sim_add_stand(struct sim_stand *stand, const double *rotation, const double *position, size_t first,
                   struct sim_equations *equations)
{
    for (size_t corner = 0; corner < stand->corners; corner++) {
        double arm[3], point[3], below[3], motion[6][3], force[3], stiffness[3][3];
        for (size_t k = 0; k < 3; k++) {
            arm[k] = dot(rotation + 3 * k, stand->corner + 3 * corner);
            point[k] = arm[k] + position[k];
            below[k] = stand->origin[k] - point[k];
        }
        const double depth = dot(below, stand->up);
        if (!(depth > 0.0)) {
            stand->has_anchor[corner] = 0;
            continue;
        }
        press_corner(stand, corner, point, depth, force, stiffness);
        set_motion(rotation, arm, motion);
        sim_add_point(equations, first, (const double (*)[3])motion, force, (const double (*)[3])stiffness);
    }
}
