#include "emulator/effects/dead.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

/* Read a world-file line `effect dead`, which adds one dead taxel: detached from the layer (`rest`, loses the share
 * `strength` of its response) or with a constant raw count (`stuck`). Returns 0, or -1 after an error line on stderr.
 */
int dead_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"rest", "stuck", NULL};
    struct dead_effect *dead = &effects->dead;
    struct dead_taxel entry = {0};
    const int form = effect_line_form_index(line, forms);
    long taxel, value = 0;
    if (form < 0 || effect_line_board(line, &entry.board)) {
        return -1;
    }
    if (dead->count == DEAD_MAX) {
        return effect_line_report_error(line, "more than 128 dead taxels");
    }
    const long last = line->boards[entry.board].taxel_count - 1;
    if (effect_line_integer(line, "taxel", 0, last, &taxel) ||
        (form == 0 && effect_line_optional(line, "strength", 0.0, 1.0, 1.0, &entry.strength)) ||
        (form == 1 && effect_line_integer(line, "value", 0, 65535, &value))) {
        return -1;
    }
    entry.taxel = (uint16_t)taxel;
    entry.is_stuck = form == 1;
    entry.value = (uint16_t)value;
    dead->taxels[dead->count++] = entry;
    return 0;
}

/* Return the parameters of the dead taxel with index `taxel` on a board, or NULL if the taxel is healthy. is_stuck:
 * search taxels with a constant raw count instead of taxels detached from the layer. */
const struct dead_taxel *dead_find_taxel(const struct dead_effect *dead, size_t board, uint16_t taxel, bool is_stuck)
{
    for (size_t i = 0; i < dead->count; i++) {
        const struct dead_taxel *entry = &dead->taxels[i];
        if (entry->board == board && entry->taxel == taxel && entry->is_stuck == is_stuck) {
            return entry;
        }
    }
    return NULL;
}
