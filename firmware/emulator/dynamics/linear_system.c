#include "emulator/dynamics/linear_system.h"

#include <math.h>

/* Solve a symmetric, positive definite system by Cholesky factorisation A = L L^T and two substitutions. Only the lower
 * triangle of `matrix` is read, and L overwrites this triangle; the solution overwrites `vector`. */
void linear_system_solve(double matrix[COORDINATES_MAX][COORDINATES_MAX], size_t count, double *vector)
{
    for (size_t i = 0; i < count; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = matrix[i][j];
            for (size_t k = 0; k < j; k++) {
                sum -= matrix[i][k] * matrix[j][k];
            }
            matrix[i][j] = i == j ? sqrt(sum) : sum / matrix[j][j];
        }
    }
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < i; k++) {
            vector[i] -= matrix[i][k] * vector[k];
        }
        vector[i] /= matrix[i][i];
    }
    for (size_t i = count; i-- > 0;) {
        for (size_t k = i + 1; k < count; k++) {
            vector[i] -= matrix[k][i] * vector[k];
        }
        vector[i] /= matrix[i][i];
    }
}
