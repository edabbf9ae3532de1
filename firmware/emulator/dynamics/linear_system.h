/* Symmetric, positive definite linear systems. */
#ifndef EMULATOR_DYNAMICS_LINEAR_SYSTEM_H
#define EMULATOR_DYNAMICS_LINEAR_SYSTEM_H

#include <stddef.h>

#include "emulator/dynamics/kinematics.h"

/* Solve A x = b by Cholesky's method. matrix: lower triangle of A, which is overwritten. vector: b on entry, x on
 * return. count: number of unknowns, at most COORDINATES_MAX. */
void linear_system_solve(double matrix[COORDINATES_MAX][COORDINATES_MAX], size_t count, double *vector);

#endif
