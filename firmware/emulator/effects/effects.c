#include "emulator/effects/effects.h"

#include <stdio.h>
#include <string.h>

#include "emulator/effects/effect_line.h"

static const struct {
    const char *name;
    int (*read)(struct effect_line *line, struct effects *effects);
} modules[] = {
    {"clock", clock_read},       {"coupling", coupling_read},   {"dead", dead_read},
    {"drift", drift_read},       {"droop", droop_read},         {"exchange", exchange_read},
    {"gain", gain_read},         {"late", late_read},           {"line", line_read},
    {"noise", noise_read},       {"nonlinear", nonlinear_read}, {"saturation", saturation_read},
    {"silent", silent_read},     {"stuck_bit", stuck_bit_read}, {"spread", spread_read},
    {"rheology", rheology_read}, {"indent", indent_read},       {"proximity", proximity_read},
    {"moisture", moisture_read}, {"modulus", modulus_read},
};

/* Read a world-file line that begins with `effect`: call the parser of the named effect, and reject keys that it has
 * not read. Returns 0, or -1 after an error line on stderr. */
int effects_read_line(struct effects *effects, const struct world_line *line, const struct board_description *boards,
                      size_t board_count)
{
    struct effect_line effect;
    if (effect_line_open(&effect, line, boards, board_count)) {
        return -1;
    }
    for (size_t i = 0; i < sizeof modules / sizeof modules[0]; i++) {
        if (strcmp(modules[i].name, effect.name) == 0) {
            return modules[i].read(&effect, effects) ? -1 : effect_line_check_keys(&effect);
        }
    }
    fprintf(stderr, "world %s, line %d: unknown effect '%s'\n", line->path, line->number, effect.name);
    return -1;
}
