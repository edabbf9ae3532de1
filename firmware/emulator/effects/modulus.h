/* Variation of the pillars' stiffness.
 *
 * The modulus of a cast silicone depends on mixing ratio and cure. Every stress in the layer is proportional to the
 * modulus, so pillars with k times the modulus shorten under a pressure p as nominal pillars do under p / k.
 *
 * Form `taxels`: k = exp(log_std n) per taxel with standard normal n (inhomogeneous mixture). Form `board`: k = factor
 * exp(gradient ((line + 1/2) / lines - 1/2)) along the TX lines of one board (another batch, cured at a temperature
 * gradient). One effect line per board; both forms may be combined. */
#ifndef EMULATOR_EFFECTS_MODULUS_H
#define EMULATOR_EFFECTS_MODULUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

struct effect_line;
struct effects;
struct board_description;

struct modulus_effect {
    double log_std;
    double log_factor[TAXEL_ADDRESS_MAX + 1]; /* by board address */
    double gradient[TAXEL_ADDRESS_MAX + 1];   /* of log k from the first to the last TX line */
};

int modulus_read(struct effect_line *line, struct effects *effects);
bool modulus_is_on(const struct modulus_effect *modulus);

/* Write the factor k of every taxel of a board to stiffness [taxels]; 1 without the effect. */
void modulus_fill(const struct modulus_effect *modulus, uint64_t seed, const struct board_description *board,
                  double *stiffness);

#endif
