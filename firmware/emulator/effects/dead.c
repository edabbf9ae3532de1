#include "emulator/effects/dead.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

int dead_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"rest", "stuck", NULL};
    struct dead_effect *dead = &effects->dead;
    struct dead_taxel one = {0};
    const int form = effect_line_form_index(line, forms);
    long taxel, value = 0;
    if (form < 0 || effect_line_board(line, &one.board)) {
        return -1;
    }
    if (dead->count == DEAD_MAX) {
        return effect_line_report_error(line, "more than 128 dead taxels");
    }
    const long last = line->boards[one.board].taxel_count - 1;
    if (effect_line_integer(line, "taxel", 0, last, &taxel) ||
        (form == 0 && effect_line_optional(line, "strength", 0.0, 1.0, 1.0, &one.strength)) ||
        (form == 1 && effect_line_integer(line, "value", 0, 65535, &value))) {
        return -1;
    }
    one.taxel = (uint16_t)taxel;
    one.stuck = form == 1;
    one.value = (uint16_t)value;
    dead->taxels[dead->count++] = one;
    return 0;
}

const struct dead_taxel *dead_find_taxel(const struct dead_effect *dead, size_t board, uint16_t taxel, bool stuck)
{
    for (size_t i = 0; i < dead->count; i++) {
        const struct dead_taxel *one = &dead->taxels[i];
        if (one->board == board && one->taxel == taxel && one->stuck == stuck) {
            return one;
        }
    }
    return NULL;
}
