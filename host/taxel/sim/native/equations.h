/* The linear equations of one time step: system v = force, with the new velocities v of all degrees of freedom. */
#ifndef TAXEL_SIM_EQUATIONS_H
#define TAXEL_SIM_EQUATIONS_H

#include <stddef.h>

struct sim_equations {
    size_t dofs;
    double step_s;
    double *system; /* [dofs][dofs] */
    double *force;  /* [dofs] */
};

/* Add a force on a point of the object to the right-hand side, and its stiffness [3][3] (N/m) times the time step to
   the matrix; both are given in the world.
   motion: [6][3], velocity of the point per unit velocity of the object's six degrees of freedom, which begin at
   `first`. */
void sim_add_point(struct sim_equations *equations, size_t first, const double motion[6][3], const double force[3],
                   const double stiffness[3][3]);

/* Solve the equations by Gaussian elimination with partial pivoting; `system` and `force` are overwritten, and `force`
   contains the velocities afterwards. Returns 0 if the system is singular. */
int sim_solve(struct sim_equations *equations);

#endif
