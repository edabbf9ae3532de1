#include "emulator/effects/clock.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/base/random.h"

#define CLOCK_STREAM 0x636C6F6300000000ull
#define PI 3.14159265358979323846
#define PARTS_PER_MILLION 1e-6

/* Read a world-file line `effect clock`: `skew` is a constant error of the oscillator (ppm), `wander` a sinusoidal
 * thermal drift (amplitude in ppm, period in seconds). Returns 0, or -1 after an error line on stderr. */
int clock_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"skew", "wander", NULL};
    struct clock_effect *clock = &effects->clock;
    const int form = effect_line_form_index(line, forms);
    struct effect_boards boards;
    double ppm, period = 0.0;
    if (form < 0 || effect_line_boards(line, &boards) || effect_line_number(line, "ppm", -1e5, 1e5, &ppm) ||
        (form == 1 && effect_line_number(line, "period", 1.0, 1e6, &period))) {
        return -1;
    }
    for (size_t i = boards.first; i < boards.end; i++) {
        (form == 0 ? clock->skew_ppm : clock->drift_ppm)[i] = ppm;
        clock->period[i] = form == 0 ? clock->period[i] : period;
    }
    return 0;
}

/* Return the thermal drift of the oscillator of one board, with a phase that depends on the seed and the I2C address.
 * The amplitude is 0 (no drift) if the world file states none. */
struct clock_drift clock_drift_open(const struct clock_effect *clock, size_t board, uint64_t seed, uint8_t address)
{
    struct random_source random;
    if (clock->drift_ppm[board] == 0.0) {
        return (struct clock_drift){0};
    }
    random_init(&random, seed, CLOCK_STREAM | address);
    return (struct clock_drift){
        .amplitude = clock->drift_ppm[board] * PARTS_PER_MILLION,
        .angular_frequency = 2.0 * PI / clock->period[board],
        .phase = 2.0 * PI * random_uniform(&random),
    };
}

/* Return the clock rate relative to its nominal value at `time` (seconds): 1 + a sin(w t + phase). */
double clock_drift_factor(const struct clock_drift *drift, double time)
{
    return 1.0 + drift->amplitude * sin(drift->angular_frequency * time + drift->phase);
}

/* Return the seconds by which the drift has advanced the clock since time 0: the integral of a sin(w t + phase). The
 * amplitude of the drift must not be 0. */
double clock_drift_offset(const struct clock_drift *drift, double time)
{
    return drift->amplitude / drift->angular_frequency *
           (cos(drift->phase) - cos(drift->angular_frequency * time + drift->phase));
}
