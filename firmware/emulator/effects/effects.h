/* Parameters of every deviation from the ideal sensor that a world file requests. The state of the effects belongs to
 * boards and skin.
 *
 * With all parameters zero the sensor is ideal. An effect that is not requested, or has strength 0, leaves every count
 * unchanged bit for bit: a hook does nothing unless its module is active, and each module samples from random sources
 * of its own. */
#ifndef EMULATOR_EFFECTS_EFFECTS_H
#define EMULATOR_EFFECTS_EFFECTS_H

#include "emulator/effects/clock.h"
#include "emulator/effects/coupling.h"
#include "emulator/effects/dead.h"
#include "emulator/effects/drift.h"
#include "emulator/effects/droop.h"
#include "emulator/effects/exchange.h"
#include "emulator/effects/gain.h"
#include "emulator/effects/indent.h"
#include "emulator/effects/late.h"
#include "emulator/effects/line.h"
#include "emulator/effects/modulus.h"
#include "emulator/effects/moisture.h"
#include "emulator/effects/noise.h"
#include "emulator/effects/nonlinear.h"
#include "emulator/effects/proximity.h"
#include "emulator/effects/rheology.h"
#include "emulator/effects/saturation.h"
#include "emulator/effects/silent.h"
#include "emulator/effects/spread.h"
#include "emulator/effects/stuck_bit.h"

struct effects {
    struct clock_effect clock;
    struct coupling_effect coupling;
    struct dead_effect dead;
    struct drift_effect drift;
    struct droop_effect droop;
    struct exchange_effect exchange;
    struct gain_effect gain;
    struct late_effect late;
    struct line_effect line;
    struct noise_effect noise;
    struct nonlinear_effect nonlinear;
    struct saturation_effect saturation;
    struct silent_effect silent;
    struct stuck_bit_effect stuck_bit;
    struct spread_effect spread;
    struct rheology_effect rheology;
    struct indent_effect indent;
    struct proximity_effect proximity;
    struct moisture_effect moisture;
    struct modulus_effect modulus;
};

struct board_description;
struct world_line;

/* Read a world-file line that begins with `effect`. boards [board_count]: the boards described in earlier lines.
 * Returns 0, or -1 after one line on stderr. */
int effects_read_line(struct effects *effects, const struct world_line *line, const struct board_description *boards,
                      size_t board_count);

#endif
