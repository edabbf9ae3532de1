#ifndef TAXEL_EMULATOR_GEOMETRY_VECTOR_H
#define TAXEL_EMULATOR_GEOMETRY_VECTOR_H

/* Products of vectors with three components. */

/* Return the scalar product of two vectors. */
static inline double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Compute the vector product of two vectors; `out` is neither of them. */
static inline void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

#endif
