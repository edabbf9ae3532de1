#include "emulator/effects/nonlinear.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

#define BOW_SKEW 0.5
#define DENOMINATOR_MAX 12

/* Read a world-file line `effect nonlinear`: leak of the modulator's integrator per clock (`dead_zone`), or bow of the
 * transfer curve in counts at mid-scale (`bow`). Returns 0, or -1 after an error line on stderr. */
int nonlinear_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"dead_zone", "bow", NULL};
    const int form = effect_line_form_index(line, forms);
    struct effect_boards boards;
    double value;
    if (form < 0 || effect_line_boards(line, &boards) ||
        effect_line_number(line, form == 0 ? "leak" : "counts", form == 0 ? 0.0 : -1000.0, form == 0 ? 0.05 : 1000.0,
                           &value)) {
        return -1;
    }
    double *const values = form == 0 ? effects->nonlinear.leak : effects->nonlinear.bow_counts;
    for (size_t i = boards.first; i < boards.end; i++) {
        values[i] = value;
    }
    return 0;
}

/* Return whether the effect `nonlinear` (dead zones or a curved characteristic) acts on board number `board`. */
bool nonlinear_is_on(const struct nonlinear_effect *nonlinear, size_t board)
{
    return nonlinear->leak[board] > 0.0 || nonlinear->bow_counts[board] != 0.0;
}

/* Return the output of a first-order modulator with a leaky integrator for an input of `share` of full scale: the
 * fraction p / q with the smallest denominator (up to 12) whose plateau contains `share`, or `share` itself if no
 * plateau contains it. The plateau of p / q is leak (1 - leak (q - 1)) / q wide. Longer patterns do not persist in a
 * modulator with noise. */
static double lock_to_plateau(double share, double leak)
{
    int near_plateau = 0; /* rarely true, so one test without branches covers all denominators */
    for (int q = 2; q <= DENOMINATOR_MAX; q++) {
        const double p = (double)(int)(share * q + 0.5);
        near_plateau |= fabs(share * q - p) <= 0.5 * leak;
    }
    if (!near_plateau) {
        return share;
    }
    for (int q = 2; q <= DENOMINATOR_MAX; q++) {
        const double p = (double)(int)(share * q + 0.5);
        if (fabs(share * q - p) <= 0.5 * leak * (1.0 - leak * (q - 1))) {
            return p / q;
        }
    }
    return share;
}

/* Return the hardware count of a nonlinear converter: with a bow (a skewed parabola, zero at both ends of the range),
 * and with the dead zones of a leaky first-order modulator, which locks to simple fractions of full scale. */
double nonlinear_count(const struct nonlinear_effect *nonlinear, size_t board, double largest_count,
                       double hardware_count)
{
    const double share = hardware_count / largest_count;
    if (share <= 0.0 || share >= 1.0) {
        return hardware_count;
    }
    const double bow =
        nonlinear->bow_counts[board] * 4.0 * share * (1.0 - share) * (1.0 + BOW_SKEW * (1.0 - 2.0 * share));
    if (nonlinear->leak[board] == 0.0) {
        return hardware_count + bow;
    }
    return largest_count * lock_to_plateau(share + bow / largest_count, nonlinear->leak[board]);
}
