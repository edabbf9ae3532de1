#include "emulator/effects/late.h"

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"

/* Read a world-file line `effect late`: delay of the counts of a board, or time constant of a low-pass filter, in
 * seconds. Returns 0, or -1 after an error line on stderr. */
int late_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"delay", "lag", NULL};
    const int form = effect_line_form_index(line, forms);
    struct effect_boards boards;
    double seconds;
    if (form < 0 || effect_line_boards(line, &boards) ||
        effect_line_number(line, "seconds", 0.0, form == 0 ? 1.0 : 10.0, &seconds)) {
        return -1;
    }
    for (size_t i = boards.first; i < boards.end; i++) {
        (form == 0 ? effects->late.delay : effects->late.lag)[i] = seconds;
    }
    return 0;
}
