#include "emulator/physics/layer.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#define TAXEL_AREA_M2 (0.005 * 0.005) /* one taxel at 5 mm pitch */
/* Ecoflex 00-30: modulus 69 kPa (maker's data sheet) over 3, incompressible */
#define SHEAR_MODULUS_PA 23000.0
#define SHEARED_HEIGHT_M 0.001    /* assumed: half of the layer, because the pillars of a grasped taxel nearly touch */
#define PILLAR_FRACTION 0.35      /* of the area; the thesis gives pillars of 0.8 mm but not their pitch */
#define SILICONE_PERMITTIVITY 2.8 /* assumed: platinum-cured silicone near 100 kHz */
/* sides of pillars touch; chosen so that the curve is flat near 50 N on a taxel */
#define BULK_STIFFNESS_PA 10000.0

/* sheet below the pillars, bonded: 3 G (1 + 2 S^2) with the shape factor S near 1 */
#define SHEET_MODULUS_PA 200000.0

/* Tables over the force on a taxel, with logarithmic steps. */
#define TABLE_SIZE 2048
#define FORCE_MIN_N 1e-4
#define FORCE_MAX_N 400.0
#define STRETCH_MIN (PILLAR_FRACTION + 0.01) /* the pressure is about 2.5 MPa there */

/* Tables of the same curve over the pressure (CURVE_STEPS per octave) and over the compression: fast look-up for many
 * cells. */
#define CURVE_MIN_PA 0x1.0p-7
#define CURVE_MAX_PA 0x1.0p24
#define CURVE_OCTAVES 31
#define CURVE_STEPS 128
#define CURVE_SHIFT 45 /* 52 bits of the mantissa minus the 7 bits of CURVE_STEPS */
#define CURVE_SIZE (CURVE_OCTAVES * CURVE_STEPS + 1)
#define DEPTH_STEPS 2048

static double rise_at_force[TABLE_SIZE];
static struct {
    double compression, rise;
} at_pressure[CURVE_SIZE];
static double rise_at_depth[DEPTH_STEPS + 1];
static double contact_depths[TABLE_SIZE];    /* compression of pillars and sheet together, metres */
static double contact_pressures[TABLE_SIZE]; /* at these compressions */
#define CONTACT_STARTS 16384                 /* so fine that the search takes a few steps also at small compressions */
/* start index of the search in contact_depths, per compression step */
static uint16_t contact_starts[CONTACT_STARTS + 1];
static double log_min, log_step;

/* Return the pressure (Pa) that compresses the pillars to `stretch` times their height (1: unloaded; PILLAR_FRACTION:
 * no air left): neo-Hookean pillars, and a stiffness that diverges as their sides touch. */
static double pillar_pressure(double stretch)
{
    const double pillars = PILLAR_FRACTION * SHEAR_MODULUS_PA * (1.0 / (stretch * stretch) - stretch);
    const double air = (stretch - PILLAR_FRACTION) / (1.0 - PILLAR_FRACTION);
    return pillars + BULK_STIFFNESS_PA * (1.0 / air - 1.0) * (1.0 - air) * (1.0 - air);
}

/* Return the relative height (1: unloaded) to which a pressure (Pa) compresses the pillars: inverse of
 * pillar_pressure(), by bisection. */
static double find_stretch(double pressure)
{
    double low = PILLAR_FRACTION + 1e-9, high = 1.0;
    for (;;) {
        const double middle = 0.5 * (low + high);
        if (middle == low || middle == high) {
            return middle; /* low and high are adjacent numbers */
        }
        if (pillar_pressure(middle) > pressure) {
            low = middle;
        } else {
            high = middle;
        }
    }
}

/* Return the relative permittivity of pillars and air at a relative height `stretch` of the pillars: logarithmic mixing
 * rule by volume (Lichtenecker, 1926). */
static double mixture_permittivity(double stretch)
{
    return pow(SILICONE_PERMITTIVITY, PILLAR_FRACTION / stretch);
}

/* Return the relative rise of the layer's permittivity over the unloaded layer at a relative height `stretch` of the
 * pillars (1: unloaded). */
static double permittivity_rise(double stretch)
{
    return mixture_permittivity(stretch) / mixture_permittivity(1.0) - 1.0;
}

/* Return the compression (metres) of the silicone sheet below the pillars under a pressure (Pa): neo-Hookean, p = E / 3
 * (1 / s^2 - s) with the relative height s, solved by bisection. */
static double sheet_compression(double pressure)
{
    double low = 1e-3, high = 1.0;
    for (int i = 0; i < 60; i++) {
        const double s = 0.5 * (low + high);
        if (SHEET_MODULUS_PA / 3.0 * (1.0 / (s * s) - s) > pressure) {
            low = s;
        } else {
            high = s;
        }
    }
    return (1.0 - 0.5 * (low + high)) * LAYER_SHEET_HEIGHT_M;
}

/* Compute the tables of the layer's curve over force, pressure and compression, which replace the slow inversion of
 * pillar_pressure(). contact_starts[] is the index in contact_depths[] at which the search for a compression starts.
 * Call once, before any other function of this file. */
void layer_init(void)
{
    log_min = log(FORCE_MIN_N);
    log_step = (log(FORCE_MAX_N) - log_min) / (TABLE_SIZE - 1);
    for (int i = 0; i < TABLE_SIZE; i++) {
        const double force = exp(log_min + i * log_step), pressure = force / TAXEL_AREA_M2;
        const double stretch = find_stretch(pressure);
        rise_at_force[i] = permittivity_rise(stretch);
        contact_depths[i] = (1.0 - stretch) * LAYER_PILLAR_HEIGHT_M + sheet_compression(pressure);
        contact_pressures[i] = pressure;
    }
    for (int i = 0, low = 0; i <= CONTACT_STARTS; i++) {
        while (low + 2 < TABLE_SIZE && contact_depths[low + 1] <= contact_depths[TABLE_SIZE - 1] * i / CONTACT_STARTS) {
            low++;
        }
        contact_starts[i] = (uint16_t)low;
    }
    for (int i = 0; i < CURVE_SIZE; i++) {
        const int octave = i / CURVE_STEPS;
        const double pressure = ldexp(CURVE_MIN_PA * (1.0 + (double)(i % CURVE_STEPS) / CURVE_STEPS), octave);
        const double stretch = find_stretch(pressure);
        at_pressure[i].compression = (1.0 - stretch) * LAYER_PILLAR_HEIGHT_M;
        at_pressure[i].rise = permittivity_rise(stretch);
    }
    for (int i = 0; i <= DEPTH_STEPS; i++) {
        rise_at_depth[i] = permittivity_rise(1.0 - (1.0 - PILLAR_FRACTION) * i / DEPTH_STEPS);
    }
}

/* Return the relative rise of the permittivity under a force (newtons) on the area of one taxel. Interpolates a
 * logarithmic table; linear below the smallest force of the table, constant above the largest. */
double layer_rise_at_force(double force_n)
{
    if (force_n <= 0.0) {
        return 0.0;
    }
    if (force_n <= FORCE_MIN_N) {
        return rise_at_force[0] * force_n / FORCE_MIN_N;
    }
    const double position = (log(force_n) - log_min) / log_step;
    const int index = (int)position;
    if (index >= TABLE_SIZE - 1) {
        return rise_at_force[TABLE_SIZE - 1];
    }
    const double fraction = position - index;
    return rise_at_force[index] + fraction * (rise_at_force[index + 1] - rise_at_force[index]);
}

/* Return the index of a pressure >= CURVE_MIN_PA in at_pressure[], and write the fraction of the step to the next
 * entry. The exponent and the first bits of the mantissa of the pressure form the index, so that no logarithm is
 * needed; the lower CURVE_SHIFT = 45 bits are the fraction. */
static int find_pressure_index(double pressure, double *fraction)
{
    const double minimum = CURVE_MIN_PA;
    uint64_t bits, first;
    memcpy(&bits, &pressure, sizeof bits);
    memcpy(&first, &minimum, sizeof first);
    const uint64_t offset = bits - first;
    *fraction = (double)(offset & ((1ull << CURVE_SHIFT) - 1u)) * 0x1.0p-45;
    return (int)(offset >> CURVE_SHIFT);
}

/* Return the compression (metres) of the pillars under a pressure (Pa); linear below the range of the table, constant
 * above it. */
double layer_compression(double pressure_pa)
{
    double fraction;
    if (pressure_pa < CURVE_MIN_PA) {
        return pressure_pa <= 0.0 ? 0.0 : at_pressure[0].compression * pressure_pa / CURVE_MIN_PA;
    }
    if (pressure_pa >= CURVE_MAX_PA) {
        return at_pressure[CURVE_SIZE - 1].compression;
    }
    const int i = find_pressure_index(pressure_pa, &fraction);
    return at_pressure[i].compression + fraction * (at_pressure[i + 1].compression - at_pressure[i].compression);
}

/* Return the relative rise of the permittivity under a pressure (Pa); linear below the range of the table, constant
 * above it. */
double layer_rise_at_pressure(double pressure_pa)
{
    double fraction;
    if (pressure_pa < CURVE_MIN_PA) {
        return pressure_pa <= 0.0 ? 0.0 : at_pressure[0].rise * pressure_pa / CURVE_MIN_PA;
    }
    if (pressure_pa >= CURVE_MAX_PA) {
        return at_pressure[CURVE_SIZE - 1].rise;
    }
    const int i = find_pressure_index(pressure_pa, &fraction);
    return at_pressure[i].rise + fraction * (at_pressure[i + 1].rise - at_pressure[i].rise);
}

/* Return the relative rise of the permittivity at a compression (metres) of the pillars; constant once no air is
 * left. */
double layer_rise_at_compression(double compression_m)
{
    const double position = compression_m * (DEPTH_STEPS / (LAYER_PILLAR_HEIGHT_M * (1.0 - PILLAR_FRACTION)));
    if (position <= 0.0) {
        return 0.0;
    }
    if (position >= DEPTH_STEPS) {
        return rise_at_depth[DEPTH_STEPS];
    }
    const int index = (int)position;
    return rise_at_depth[index] + (position - index) * (rise_at_depth[index + 1] - rise_at_depth[index]);
}

/* Return the volume fraction of air at a relative rise of the permittivity: the inverse of Lichtenecker's mixing
 * rule. */
double layer_air_fraction(double rise)
{
    return fmax(1.0 - PILLAR_FRACTION - log1p(rise) / log(SILICONE_PERMITTIVITY), 0.0);
}

/* Return the relative permittivity of the uncompressed layer. */
double layer_rest_permittivity(void)
{
    return mixture_permittivity(1.0);
}

/* Return the derivative of pillar_pressure() with respect to the stretch (relative height of the pillars): the sum of
 * the derivatives of its two terms. */
static double pillar_pressure_slope(double stretch)
{
    const double pillars = PILLAR_FRACTION * SHEAR_MODULUS_PA * (-2.0 / (stretch * stretch * stretch) - 1.0);
    const double air = (stretch - PILLAR_FRACTION) / (1.0 - PILLAR_FRACTION);
    const double closed = 1.0 - air; /* share of the air between the pillars that the compression has displaced */
    const double bulk = -closed * closed / (air * air) - 2.0 * closed * (1.0 / air - 1.0);
    return pillars + BULK_STIFFNESS_PA * bulk / (1.0 - PILLAR_FRACTION);
}

/* Return the pressure (Pa) at a compression (metres) of the pillars. Where almost no air is left, the curve continues
 * as its tangent, so that a solver always gets a finite value. */
double layer_pressure(double compression_m)
{
    const double stretch = 1.0 - compression_m / LAYER_PILLAR_HEIGHT_M;
    if (compression_m <= 0.0) {
        return 0.0;
    }
    if (stretch < STRETCH_MIN) {
        return pillar_pressure(STRETCH_MIN) + pillar_pressure_slope(STRETCH_MIN) * (stretch - STRETCH_MIN);
    }
    return pillar_pressure(stretch);
}

/* Return the derivative (Pa/m) of layer_pressure() at a compression (metres) of the pillars; 0 without compression. */
double layer_stiffness(double compression_m)
{
    const double stretch = 1.0 - compression_m / LAYER_PILLAR_HEIGHT_M;
    const double slope = pillar_pressure_slope(stretch < STRETCH_MIN ? STRETCH_MIN : stretch);
    return compression_m <= 0.0 ? 0.0 : -slope / LAYER_PILLAR_HEIGHT_M;
}

/* Return the work per area and per height (Pa) that compresses the pillars to the relative height `stretch`: the
 * integral of pillar_pressure() from `stretch` to 1, as the sum of the integrals of its two terms. */
static double pillar_work(double stretch)
{
    const double pillars = PILLAR_FRACTION * SHEAR_MODULUS_PA * (1.0 / stretch - 1.0 - 0.5 * (1.0 - stretch * stretch));
    const double air = (stretch - PILLAR_FRACTION) / (1.0 - PILLAR_FRACTION);
    const double bulk = -log(air) - 3.0 * (1.0 - air) + 1.5 * (1.0 - air * air) - (1.0 - air * air * air) / 3.0;
    return pillars + BULK_STIFFNESS_PA * (1.0 - PILLAR_FRACTION) * bulk;
}

/* Return the work per area (J/m2) that compresses the pillars by `compression_m`: the integral of layer_pressure().
 * Below STRETCH_MIN, where layer_pressure() is linear, the trapezoid rule gives the exact integral. */
double layer_work(double compression_m)
{
    const double stretch = 1.0 - compression_m / LAYER_PILLAR_HEIGHT_M;
    if (compression_m <= 0.0) {
        return 0.0;
    }
    if (stretch < STRETCH_MIN) {
        const double beyond = (STRETCH_MIN - stretch) * LAYER_PILLAR_HEIGHT_M;
        const double mean = 0.5 * (layer_pressure(compression_m) + pillar_pressure(STRETCH_MIN));
        return pillar_work(STRETCH_MIN) * LAYER_PILLAR_HEIGHT_M + mean * beyond;
    }
    return pillar_work(stretch) * LAYER_PILLAR_HEIGHT_M;
}

/* Return the pressure (Pa) at a compression (metres) of pillars and sheet together, and write its derivative *rate
 * (Pa/m). The pressure is exponential in the compression between two entries of the table, and linear before the first
 * and after the last entry. */
static double evaluate_contact_pressure(double compression_m, double *rate)
{
    const double last = contact_depths[TABLE_SIZE - 1];
    if (compression_m <= contact_depths[0]) {
        *rate = contact_pressures[0] / contact_depths[0];
        return *rate * compression_m;
    }
    if (compression_m >= last) {
        *rate = contact_pressures[TABLE_SIZE - 1] * log_step / (last - contact_depths[TABLE_SIZE - 2]);
        return contact_pressures[TABLE_SIZE - 1] + *rate * (compression_m - last);
    }
    int low = contact_starts[(int)(compression_m / last * CONTACT_STARTS)];
    while (contact_depths[low + 1] <= compression_m) {
        low++;
    }
    const double growth = log_step / (contact_depths[low + 1] - contact_depths[low]);
    const double x = growth * (compression_m - contact_depths[low]);
    /* exp(x) for x below log_step: four terms of the series leave a relative error of 2e-10 */
    const double pressure = contact_pressures[low] * (1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0)));
    *rate = pressure * growth;
    return pressure;
}

/* Return the pressure (Pa) between layer and object at a compression of the layer in metres, and write its derivative
 * *rate (Pa/m); both are 0 without compression. */
double layer_contact_curve(double compression_m, double *rate)
{
    *rate = 0.0;
    return compression_m <= 0.0 ? 0.0 : evaluate_contact_pressure(compression_m, rate);
}

/* Compute the pressures (Pa) between layer and object at `count` compressions of the layer in metres, and their
 * derivatives (Pa/m). */
void layer_contact_curves(const double *compression_m, size_t count, double *pressure, double *rate)
{
    for (size_t i = 0; i < count; i++) {
        pressure[i] = layer_contact_curve(compression_m[i], &rate[i]);
    }
}

/* Return the pressure (Pa) between layer and object at a compression of the layer in metres; 0 without compression. */
double layer_contact_pressure(double compression_m)
{
    double rate;
    return layer_contact_curve(compression_m, &rate);
}

/* Return the derivative of the contact pressure with respect to the compression, in pascal per metre; 0 without
 * compression. */
double layer_contact_stiffness(double compression_m)
{
    double rate;
    (void)layer_contact_curve(compression_m, &rate);
    return rate;
}

/* Return the compression of the layer in metres at a contact pressure in pascal; 0 at a pressure of 0 or less. The
 * compressions of the table are interpolated linearly in the logarithm of the pressure. Below the first entry and above
 * the last entry, the compression is linear in the pressure. */
double layer_contact_compression(double pressure_pa)
{
    const double last_pressure = contact_pressures[TABLE_SIZE - 1];
    if (pressure_pa <= contact_pressures[0]) {
        return fmax(pressure_pa, 0.0) / contact_pressures[0] * contact_depths[0];
    }
    if (pressure_pa >= last_pressure) {
        const double depth = contact_depths[TABLE_SIZE - 1], depth_before = contact_depths[TABLE_SIZE - 2];
        return depth + (pressure_pa / last_pressure - 1.0) * (depth - depth_before) / log_step;
    }
    const double position = log(pressure_pa / contact_pressures[0]) / log_step;
    const int low = (int)fmin(position, TABLE_SIZE - 2);
    return contact_depths[low] + (position - low) * (contact_depths[low + 1] - contact_depths[low]);
}

/* Return the shear stiffness of the layer in pascal per metre: shear modulus / sheared height. */
double layer_shear_stiffness(void)
{
    return SHEAR_MODULUS_PA / SHEARED_HEIGHT_M;
}
