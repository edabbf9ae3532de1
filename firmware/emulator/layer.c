#include "emulator/layer.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#define CELL_AREA_M2 (0.005 * 0.005)      /* one taxel at 5 mm pitch */
#define SHEAR_MODULUS_PA 23000.0          /* Ecoflex 00-30: modulus 69 kPa (maker's data sheet) over 3, incompressible */
#define PILLAR_FRACTION 0.35              /* of the area; the thesis gives pillars of 0.8 mm but not their pitch */
#define SILICONE_PERMITTIVITY 2.8         /* platinum-cured silicone at some 100 kHz */
#define BULK_STIFFNESS_PA 10000.0         /* sets in as the pillars' flanks meet; flat near 50 N on a taxel */

#define SHEET_MODULUS_PA 200000.0         /* the sheet under them, hindered from bulging: 3 G (1 + 2 S^2), shape factor S near 1 */

#define TABLE_SIZE 2048
#define FORCE_MIN_N 1e-4
#define FORCE_MAX_N 400.0
#define STRETCH_LAST (PILLAR_FRACTION + 0.01) /* a cell's pressure is some 2.5 MPa there */

/* The same curve over the pressure, CURVE_STEPS to the octave, and over the compression: quick, for many cells. */
#define CURVE_MIN_PA 0x1.0p-7
#define CURVE_MAX_PA 0x1.0p24
#define CURVE_OCTAVES 31
#define CURVE_STEPS 128
#define CURVE_SHIFT 45 /* 52 bits of mantissa less the 7 of CURVE_STEPS */
#define CURVE_SIZE (CURVE_OCTAVES * CURVE_STEPS + 1)
#define DEPTH_STEPS 2048

static double table[TABLE_SIZE];
static struct {
    double compression, rise;
} curve[CURVE_SIZE];
static double depth_table[DEPTH_STEPS + 1];
static double contact_table[TABLE_SIZE];     /* of the pillars and the sheet under them, metres */
static double contact_pressures[TABLE_SIZE]; /* at those compressions */
#define CONTACT_STARTS 1024
static uint16_t contact_starts[CONTACT_STARTS + 1]; /* an entry at or before each of so many steps of the compression */
static double log_min, log_step;

/* Pressure that shortens the pillars to `stretch` of their height (1: unloaded; PILLAR_FRACTION: no air left). */
static double pressure_of(double stretch)
{
    const double pillars = PILLAR_FRACTION * SHEAR_MODULUS_PA * (1.0 / (stretch * stretch) - stretch);
    const double air = (stretch - PILLAR_FRACTION) / (1.0 - PILLAR_FRACTION);
    return pillars + BULK_STIFFNESS_PA * (1.0 / air - 1.0) * (1.0 - air) * (1.0 - air);
}

static double stretch_of(double pressure)
{
    double low = PILLAR_FRACTION + 1e-9, high = 1.0;
    for (;;) {
        const double middle = 0.5 * (low + high);
        if (middle == low || middle == high) {
            return middle; /* there is no number between them */
        }
        if (pressure_of(middle) > pressure) {
            low = middle;
        } else {
            high = middle;
        }
    }
}

/* Logarithmic mixing rule (Lichtenecker, 1926) of air and silicone by volume. */
static double permittivity_of(double stretch)
{
    return pow(SILICONE_PERMITTIVITY, PILLAR_FRACTION / stretch);
}

static double rise_of(double stretch)
{
    return permittivity_of(stretch) / permittivity_of(1.0) - 1.0;
}

/* How much the sheet under the pillars gives way, neo-Hookean in compression: p = E / 3 (1 / s^2 - s). */
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

void layer_init(void)
{
    log_min = log(FORCE_MIN_N);
    log_step = (log(FORCE_MAX_N) - log_min) / (TABLE_SIZE - 1);
    for (int i = 0; i < TABLE_SIZE; i++) {
        const double force = exp(log_min + i * log_step), pressure = force / CELL_AREA_M2;
        const double stretch = stretch_of(pressure);
        table[i] = rise_of(stretch);
        contact_table[i] = (1.0 - stretch) * LAYER_PILLAR_HEIGHT_M + sheet_compression(pressure);
        contact_pressures[i] = pressure;
    }
    for (int i = 0, low = 0; i <= CONTACT_STARTS; i++) {
        while (low + 2 < TABLE_SIZE && contact_table[low + 1] <= contact_table[TABLE_SIZE - 1] * i / CONTACT_STARTS) {
            low++;
        }
        contact_starts[i] = (uint16_t)low;
    }
    for (int i = 0; i < CURVE_SIZE; i++) {
        const int octave = i / CURVE_STEPS;
        const double pressure = ldexp(CURVE_MIN_PA * (1.0 + (double)(i % CURVE_STEPS) / CURVE_STEPS), octave);
        const double stretch = stretch_of(pressure);
        curve[i].compression = (1.0 - stretch) * LAYER_PILLAR_HEIGHT_M;
        curve[i].rise = rise_of(stretch);
    }
    for (int i = 0; i <= DEPTH_STEPS; i++) {
        depth_table[i] = rise_of(1.0 - (1.0 - PILLAR_FRACTION) * i / DEPTH_STEPS);
    }
}

double layer_permittivity_rise(double force_n)
{
    if (force_n <= 0.0) {
        return 0.0;
    }
    if (force_n <= FORCE_MIN_N) {
        return table[0] * force_n / FORCE_MIN_N;
    }
    const double position = (log(force_n) - log_min) / log_step;
    const int index = (int)position;
    if (index >= TABLE_SIZE - 1) {
        return table[TABLE_SIZE - 1];
    }
    const double fraction = position - index;
    return table[index] + fraction * (table[index + 1] - table[index]);
}

/* Place of a pressure of CURVE_MIN_PA or more in the curve: its exponent and the first bits of its mantissa are the index. */
static int curve_index(double pressure, double *fraction)
{
    const double least = CURVE_MIN_PA;
    uint64_t bits, first;
    memcpy(&bits, &pressure, sizeof bits);
    memcpy(&first, &least, sizeof first);
    const uint64_t place = bits - first;
    *fraction = (double)(place & ((1ull << CURVE_SHIFT) - 1u)) * 0x1.0p-45;
    return (int)(place >> CURVE_SHIFT);
}

double layer_compression(double pressure_pa)
{
    double fraction;
    if (pressure_pa < CURVE_MIN_PA) {
        return pressure_pa <= 0.0 ? 0.0 : curve[0].compression * pressure_pa / CURVE_MIN_PA;
    }
    if (pressure_pa >= CURVE_MAX_PA) {
        return curve[CURVE_SIZE - 1].compression;
    }
    const int i = curve_index(pressure_pa, &fraction);
    return curve[i].compression + fraction * (curve[i + 1].compression - curve[i].compression);
}

double layer_pressure_rise(double pressure_pa)
{
    double fraction;
    if (pressure_pa < CURVE_MIN_PA) {
        return pressure_pa <= 0.0 ? 0.0 : curve[0].rise * pressure_pa / CURVE_MIN_PA;
    }
    if (pressure_pa >= CURVE_MAX_PA) {
        return curve[CURVE_SIZE - 1].rise;
    }
    const int i = curve_index(pressure_pa, &fraction);
    return curve[i].rise + fraction * (curve[i + 1].rise - curve[i].rise);
}

double layer_compression_rise(double compression_m)
{
    const double position = compression_m * (DEPTH_STEPS / (LAYER_PILLAR_HEIGHT_M * (1.0 - PILLAR_FRACTION)));
    if (position <= 0.0) {
        return 0.0;
    }
    if (position >= DEPTH_STEPS) {
        return depth_table[DEPTH_STEPS];
    }
    const int index = (int)position;
    return depth_table[index] + (position - index) * (depth_table[index + 1] - depth_table[index]);
}

double layer_pores(double rise)
{
    return fmax(1.0 - PILLAR_FRACTION - log1p(rise) / log(SILICONE_PERMITTIVITY), 0.0);
}

double layer_permittivity(void)
{
    return permittivity_of(1.0);
}

/* The slope of pressure_of(), by its two terms. */
static double slope_of(double stretch)
{
    const double pillars = PILLAR_FRACTION * SHEAR_MODULUS_PA * (-2.0 / (stretch * stretch * stretch) - 1.0);
    const double air = (stretch - PILLAR_FRACTION) / (1.0 - PILLAR_FRACTION);
    const double open = 1.0 - air;
    const double bulk = -open * open / (air * air) - 2.0 * open * (1.0 / air - 1.0);
    return pillars + BULK_STIFFNESS_PA * bulk / (1.0 - PILLAR_FRACTION);
}

double layer_pressure(double compression_m)
{
    const double stretch = 1.0 - compression_m / LAYER_PILLAR_HEIGHT_M;
    if (compression_m <= 0.0) {
        return 0.0;
    }
    if (stretch < STRETCH_LAST) {
        return pressure_of(STRETCH_LAST) + slope_of(STRETCH_LAST) * (stretch - STRETCH_LAST);
    }
    return pressure_of(stretch);
}

double layer_stiffness(double compression_m)
{
    const double stretch = 1.0 - compression_m / LAYER_PILLAR_HEIGHT_M;
    return compression_m <= 0.0 ? 0.0 : -slope_of(stretch < STRETCH_LAST ? STRETCH_LAST : stretch) / LAYER_PILLAR_HEIGHT_M;
}

/* The integral of pressure_of() from `stretch` to 1, by its two terms. */
static double work_of(double stretch)
{
    const double pillars = PILLAR_FRACTION * SHEAR_MODULUS_PA * (1.0 / stretch - 1.0 - 0.5 * (1.0 - stretch * stretch));
    const double air = (stretch - PILLAR_FRACTION) / (1.0 - PILLAR_FRACTION);
    const double open = -log(air) - 3.0 * (1.0 - air) + 1.5 * (1.0 - air * air) - (1.0 - air * air * air) / 3.0;
    return pillars + BULK_STIFFNESS_PA * (1.0 - PILLAR_FRACTION) * open;
}

double layer_work(double compression_m)
{
    const double stretch = 1.0 - compression_m / LAYER_PILLAR_HEIGHT_M;
    if (compression_m <= 0.0) {
        return 0.0;
    }
    if (stretch < STRETCH_LAST) {
        const double beyond = (STRETCH_LAST - stretch) * LAYER_PILLAR_HEIGHT_M;
        const double mean = 0.5 * (layer_pressure(compression_m) + pressure_of(STRETCH_LAST));
        return work_of(STRETCH_LAST) * LAYER_PILLAR_HEIGHT_M + mean * beyond;
    }
    return work_of(stretch) * LAYER_PILLAR_HEIGHT_M;
}

/* Pressure between two entries of the contact table is exponential in the compression; before the first and after the last it is
 * a line. */
static double contact_law(double compression_m, double *rate)
{
    const double last = contact_table[TABLE_SIZE - 1];
    if (compression_m <= contact_table[0]) {
        *rate = contact_pressures[0] / contact_table[0];
        return *rate * compression_m;
    }
    if (compression_m >= last) {
        *rate = contact_pressures[TABLE_SIZE - 1] * log_step / (last - contact_table[TABLE_SIZE - 2]);
        return contact_pressures[TABLE_SIZE - 1] + *rate * (compression_m - last);
    }
    int low = contact_starts[(int)(compression_m / last * CONTACT_STARTS)];
    while (contact_table[low + 1] <= compression_m) {
        low++;
    }
    const double growth = log_step / (contact_table[low + 1] - contact_table[low]);
    const double pressure = contact_pressures[low] * exp(growth * (compression_m - contact_table[low]));
    *rate = pressure * growth;
    return pressure;
}

double layer_contact_pressure(double compression_m)
{
    double rate;
    return compression_m <= 0.0 ? 0.0 : contact_law(compression_m, &rate);
}

double layer_contact_stiffness(double compression_m)
{
    double rate = 0.0;
    if (compression_m > 0.0) {
        (void)contact_law(compression_m, &rate);
    }
    return rate;
}
