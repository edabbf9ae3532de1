#include "emulator/effects/clock.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/random.h"

#define CLOCK_STREAM 0x636C6F6300000000ull
#define PI 3.14159265358979323846
#define PARTS_PER_MILLION 1e-6

int clock_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"skew", "wander", NULL};
    struct clock_effect *clock = &effects->clock;
    const int form = effect_line_form(line, forms);
    struct effect_boards boards;
    double ppm, period = 0.0;
    if (form < 0 || effect_line_boards(line, &boards) || effect_line_number(line, "ppm", -1e5, 1e5, &ppm) ||
        (form == 1 && effect_line_number(line, "period", 1.0, 1e6, &period))) {
        return -1;
    }
    for (size_t i = boards.first; i < boards.end; i++) {
        (form == 0 ? clock->skew_ppm : clock->wander_ppm)[i] = ppm;
        clock->period[i] = form == 0 ? clock->period[i] : period;
    }
    return 0;
}

struct clock_wander clock_wander_open(const struct clock_effect *clock, size_t board, uint64_t seed, uint8_t address)
{
    struct random_source random;
    if (clock->wander_ppm[board] == 0.0) {
        return (struct clock_wander){0};
    }
    random_init(&random, seed, CLOCK_STREAM | address);
    return (struct clock_wander){
        .amplitude = clock->wander_ppm[board] * PARTS_PER_MILLION,
        .radian_a_second = 2.0 * PI / clock->period[board],
        .phase = 2.0 * PI * random_uniform(&random),
    };
}

double clock_wander_rate(const struct clock_wander *wander, double time)
{
    return 1.0 + wander->amplitude * sin(wander->radian_a_second * time + wander->phase);
}

double clock_wander_ahead(const struct clock_wander *wander, double time)
{
    return wander->amplitude / wander->radian_a_second * (cos(wander->phase) - cos(wander->radian_a_second * time + wander->phase));
}
