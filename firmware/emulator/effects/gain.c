#include "emulator/effects/gain.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/physics/front_end.h"

#define ELECTRODE_STREAM 0x6761696E00000000ull
#define IDAC_STREAM 0x6964616300000000ull

/* Read a world-file line `effect gain`: a factor and a log-normal tolerance of the electrodes or of the current source
 * (IDAC) of a board. Lines multiply: log factors and variances add. Returns 0, or -1 after an error line on stderr. */
int gain_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {"electrode", "idac", NULL};
    const int form = effect_line_form_index(line, forms);
    struct effect_boards boards;
    double log_std, factor;
    if (form < 0 || effect_line_boards(line, &boards) ||
        effect_line_optional(line, "log_std", 0.0, 2.0, 0.0, &log_std) ||
        effect_line_optional(line, "factor", 0.01, 10.0, 1.0, &factor)) {
        return -1;
    }
    struct gain_board *const boards_gain = form == 0 ? effects->gain.electrode : effects->gain.idac;
    for (size_t i = boards.first; i < boards.end; i++) {
        boards_gain[i].log_factor += log(factor);
        boards_gain[i].log_std = hypot(boards_gain[i].log_std, log_std); /* independent variances add */
    }
    return 0;
}

/* Multiply the fringe capacitance of each taxel and the IDAC gain of the board by random factors exp(log_factor +
 * log_std n), n standard normal. Call once, before the front end is configured. */
void gain_apply(const struct gain_effect *gain, size_t board, uint64_t seed, uint8_t address,
                struct front_end *front_end)
{
    const struct gain_board *electrode = &gain->electrode[board], *idac = &gain->idac[board];
    struct random_source random;
    if (electrode->log_factor != 0.0 || electrode->log_std > 0.0) {
        random_init(&random, seed, ELECTRODE_STREAM | address);
        for (uint16_t i = 0; i < front_end->taxel_count; i++) {
            front_end->taxels[i].fringe_f *= exp(electrode->log_factor + electrode->log_std * random_normal(&random));
        }
    }
    if (idac->log_factor != 0.0 || idac->log_std > 0.0) {
        random_init(&random, seed, IDAC_STREAM | address);
        front_end->idac_gain = exp(idac->log_factor + idac->log_std * random_normal(&random));
    }
}
