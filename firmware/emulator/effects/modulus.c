#include "emulator/effects/modulus.h"

#include <math.h>

#include "emulator/effects/effect_line.h"
#include "emulator/effects/effects.h"
#include "emulator/base/random.h"

#define MODULUS_STREAM 0x6D6F64756C757300ull /* the board's address is added */

enum modulus_form {
    MODULUS_TAXELS,
    MODULUS_BOARD,
};

/* Read a world-file line `effect modulus`: log-normal variation of the stiffness between taxels, or a factor and a
 * gradient from the first to the last TX line of one board. Returns 0, or -1 after an error line on stderr. */
int modulus_read(struct effect_line *line, struct effects *effects)
{
    static const char *const forms[] = {[MODULUS_TAXELS] = "taxels", [MODULUS_BOARD] = "board", NULL};
    struct modulus_effect *modulus = &effects->modulus;
    const int form = effect_line_form_index(line, forms);
    size_t index;
    double factor, gradient;
    if (form < 0) {
        return -1;
    }
    if (form == MODULUS_TAXELS) {
        return effect_line_number(line, "log_std", 0.0, 1.0, &modulus->log_std);
    }
    if (effect_line_board(line, &index) || effect_line_number(line, "factor", 0.2, 5.0, &factor) ||
        effect_line_optional(line, "gradient", -1.0, 1.0, 0.0, &gradient)) {
        return -1;
    }
    const uint8_t address = line->boards[index].address;
    modulus->log_factor[address] = log(factor);
    modulus->gradient[address] = gradient;
    return 0;
}

/* Return whether any board has pillars that are not of nominal stiffness. */
bool modulus_is_on(const struct modulus_effect *modulus)
{
    bool is_on = modulus->log_std != 0.0;
    for (size_t i = 0; i <= TAXEL_ADDRESS_MAX; i++) {
        is_on = is_on || modulus->log_factor[i] != 0.0 || modulus->gradient[i] != 0.0;
    }
    return is_on;
}

/* Sample the stiffness of each taxel of a board relative to nominal: exp(log_factor + gradient (x - 1/2) + log_std n),
 * with x = (TX line + 1/2) / number of TX lines and a standard normal n. stiffness: [taxels], in the order of the
 * crossing map. */
void modulus_fill(const struct modulus_effect *modulus, uint64_t seed, const struct board_description *board,
                  double *stiffness)
{
    struct random_source random;
    size_t taxel = 0;
    random_init(&random, seed, MODULUS_STREAM + board->address);
    for (unsigned crossing = 0; crossing < (unsigned)board->rows * board->columns; crossing++) {
        const bool has_taxel = (board->crossing_map[crossing >> 3] >> (crossing & 7u)) & 1;
        if (has_taxel && taxel < board->taxel_count) {
            const unsigned line = crossing / board->columns;
            const double relative_line = (line + 0.5) / board->rows - 0.5;
            stiffness[taxel++] =
                exp(modulus->log_factor[board->address] + modulus->gradient[board->address] * relative_line +
                    modulus->log_std * random_normal(&random));
        }
    }
}
