#include "emulator/effects/stuck_bit.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

/* Read a world-file line `effect stuck_bit`: add one bit to the mask of bits of the raw count that always read 0
 * (`low`) or 1 (`high`). Returns 0, or -1 after an error line on stderr. */
int stuck_bit_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"low", "high", NULL};
    const int form = effect_line_form_index(line, forms);
    struct effect_boards boards;
    long bit;
    if (form < 0 || effect_line_boards(line, &boards) || effect_line_integer(line, "bit", 0, 15, &bit)) {
        return -1;
    }
    uint16_t *const masks = form == 0 ? effects->stuck_bit.low : effects->stuck_bit.high;
    for (size_t i = boards.first; i < boards.end; i++) {
        masks[i] = (uint16_t)(masks[i] | (1u << bit));
    }
    return 0;
}
