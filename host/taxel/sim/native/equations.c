#include "equations.h"

#include <math.h>

#define MOTIONS 6

/* Add the force f on a point of the object to the right-hand side, and its stiffness K (N/m) to the matrix. The added
   terms are M f and step M K M^T. M is `motion`: the velocity of the point per unit velocity of each of the object's
   six degrees of freedom. first: index of the first of these degrees of freedom. */
void sim_add_point(struct sim_equations *equations, size_t first, const double motion[6][3], const double force[3],
                   const double stiffness[3][3])
{
    for (size_t i = 0; i < MOTIONS; i++) {
        double *row = equations->system + (first + i) * equations->dofs + first;
        double turned[3] = {0.0};
        for (size_t k = 0; k < 3; k++) {
            equations->force[first + i] += motion[i][k] * force[k];
            for (size_t j = 0; j < 3; j++) {
                turned[j] += motion[i][k] * stiffness[k][j];
            }
        }
        for (size_t j = 0; j < MOTIONS; j++) {
            row[j] +=
                equations->step_s * (turned[0] * motion[j][0] + turned[1] * motion[j][1] + turned[2] * motion[j][2]);
        }
    }
}

/* Exchange the rows a and b of matrix and right-hand side. */
static void exchange_rows(struct sim_equations *equations, size_t a, size_t b)
{
    for (size_t j = 0; j < equations->dofs; j++) {
        const double number = equations->system[a * equations->dofs + j];
        equations->system[a * equations->dofs + j] = equations->system[b * equations->dofs + j];
        equations->system[b * equations->dofs + j] = number;
    }
    const double force = equations->force[a];
    equations->force[a] = equations->force[b];
    equations->force[b] = force;
}

/* Solve the equations by Gaussian elimination with partial pivoting: `force` then contains the velocities. Returns 1,
   or 0 if the system is singular. Elements below the diagonal are not set to 0, because no later step reads them. */
int sim_solve(struct sim_equations *equations)
{
    const size_t n = equations->dofs;
    double *a = equations->system, *b = equations->force;
    for (size_t column = 0; column < n; column++) {
        size_t pivot = column;
        for (size_t row = column + 1; row < n; row++) {
            pivot = fabs(a[row * n + column]) > fabs(a[pivot * n + column]) ? row : pivot;
        }
        if (!(fabs(a[pivot * n + column]) > 0.0)) {
            return 0;
        }
        if (pivot != column) {
            exchange_rows(equations, pivot, column);
        }
        for (size_t row = column + 1; row < n; row++) {
            const double factor = a[row * n + column] / a[column * n + column];
            if (factor == 0.0) {
                continue;
            }
            for (size_t j = column + 1; j < n; j++) {
                a[row * n + j] -= factor * a[column * n + j];
            }
            b[row] -= factor * b[column];
        }
    }
    for (size_t row = n; row-- > 0;) {
        for (size_t j = row + 1; j < n; j++) {
            b[row] -= a[row * n + j] * b[j];
        }
        b[row] /= a[row * n + row];
    }
    return 1;
}
