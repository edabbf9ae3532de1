/* The factor of Marsaglia's polar method (1964): sqrt(-2 log(s) / s) for s in (0, 1).
 *
 * The logarithm is computed here and not by the C library: the results are then identical to the bit with every C
 * library, and the compiler can vectorise the computation. */
#ifndef EMULATOR_BASE_POLAR_H
#define EMULATOR_BASE_POLAR_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define POLAR_LN_2 0.69314718055994530942
#define POLAR_SQRT_2 1.41421356237309504880
#define POLAR_MANTISSA 0x000FFFFFFFFFFFFFull
#define POLAR_ONE 0x3FF0000000000000ull
/* bits of 2^52; with an integer n < 2^52 in the mantissa they are the double 2^52 + n */
#define POLAR_2_52 0x4330000000000000ull

/* Return the double with these bits. */
static inline double polar_bits_to_double(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Return the natural logarithm of s: log(2^e m) = e log 2 + 2 artanh((m - 1) / (m + 1)) with m between sqrt(1/2) and
 * sqrt(2). The truncated terms of the series are below 1e-17. */
static inline double polar_log(double s)
{
    uint64_t bits;
    memcpy(&bits, &s, sizeof bits);
    const double mantissa = polar_bits_to_double((bits & POLAR_MANTISSA) | POLAR_ONE);
    const double exponent = polar_bits_to_double((bits >> 52) | POLAR_2_52) - (0x1.0p52 + 1023.0);
    const double halved = mantissa > POLAR_SQRT_2 ? 1.0 : 0.0;
    const double m = mantissa - halved * 0.5 * mantissa;
    const double x = (m - 1.0) / (m + 1.0), square = x * x;
    double sum = 1.0 / 21.0;
    sum = sum * square + 1.0 / 19.0;
    sum = sum * square + 1.0 / 17.0;
    sum = sum * square + 1.0 / 15.0;
    sum = sum * square + 1.0 / 13.0;
    sum = sum * square + 1.0 / 11.0;
    sum = sum * square + 1.0 / 9.0;
    sum = sum * square + 1.0 / 7.0;
    sum = sum * square + 1.0 / 5.0;
    sum = sum * square + 1.0 / 3.0;
    return (exponent + halved) * POLAR_LN_2 + 2.0 * (x + x * (square * sum));
}

/* Return the factor by which the polar method multiplies a point at the squared distance s from the origin. */
static inline double polar_factor(double s)
{
    return sqrt(-2.0 * polar_log(s) / s);
}

#endif
