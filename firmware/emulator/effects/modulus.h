/* Pillars that are softer or stiffer than the layer's curve says.
 *
 * The modulus of a cast silicone follows mixing ratio and cure. Every stress in the layer is proportional to it, so pillars of
 * k times the modulus shorten under a pressure p as far as those of the curve under p / k.
 *
 * Form `taxels`: k = exp(log_std n) of every taxel, n normal with mean 0: mixed badly.
 * Form `board`: one board's k = factor exp(gradient (line / lines - 1/2)), along its TX lines: another batch, cured on a plate
 * that was warmer on one side. A line of its own for each board; both forms may act together. */
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
    double gradient[TAXEL_ADDRESS_MAX + 1];   /* of log k from the first TX line to the last */
};

int modulus_read(struct effect_line *line, struct effects *effects);
bool modulus_is_on(const struct modulus_effect *modulus);

/* k of every taxel of a board, or all 1. stiffness [taxels]. */
void modulus_fill(const struct modulus_effect *modulus, uint64_t seed, const struct board_description *board, double *stiffness);

#endif
