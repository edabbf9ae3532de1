#include "emulator/layer.h"

#include <math.h>

#define CELL_AREA_M2 (0.005 * 0.005)      /* one taxel at 5 mm pitch */
#define SHEAR_MODULUS_PA 23000.0          /* Ecoflex 00-30: modulus 69 kPa (maker's data sheet) over 3, incompressible */
#define PILLAR_FRACTION 0.35              /* of the area; the thesis gives pillars of 0.8 mm but not their pitch */
#define SILICONE_PERMITTIVITY 2.8         /* platinum-cured silicone at some 100 kHz */
#define BULK_STIFFNESS_PA 40000.0         /* sets in as the pillars' flanks meet; puts saturation near 50 N */

#define TABLE_SIZE 2048
#define FORCE_MIN_N 1e-4
#define FORCE_MAX_N 400.0

static double table[TABLE_SIZE];
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
    for (int i = 0; i < 80; i++) {
        const double middle = 0.5 * (low + high);
        if (pressure_of(middle) > pressure) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return 0.5 * (low + high);
}

/* Logarithmic mixing rule (Lichtenecker, 1926) of air and silicone by volume. */
static double permittivity_of(double stretch)
{
    return pow(SILICONE_PERMITTIVITY, PILLAR_FRACTION / stretch);
}

static double rise_of(double force_n)
{
    return permittivity_of(stretch_of(force_n / CELL_AREA_M2)) / permittivity_of(1.0) - 1.0;
}

void layer_init(void)
{
    log_min = log(FORCE_MIN_N);
    log_step = (log(FORCE_MAX_N) - log_min) / (TABLE_SIZE - 1);
    for (int i = 0; i < TABLE_SIZE; i++) {
        table[i] = rise_of(exp(log_min + i * log_step));
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
