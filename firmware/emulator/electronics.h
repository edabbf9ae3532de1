/* A board's way from capacitance to raw count when it is not the ideal one: every effect in the place where it acts.
 *
 *   fields -> capacitances (drift, dead, exchanged, broken and joined lines) -> network of the lines -> supply and reference
 *   -> low pass -> noise -> saturation -> converter -> quantised -> bits
 *
 * A board on which no such effect acts has no electronics: front_end_convert() serves it. */
#ifndef EMULATOR_ELECTRONICS_H
#define EMULATOR_ELECTRONICS_H

#include "emulator/effects/drift.h"
#include "emulator/effects/droop.h"
#include "emulator/effects/coupling.h"
#include "emulator/effects/noise.h"
#include "emulator/front_end.h"
#include "emulator/world_file.h"

#define ELECTRONICS_NO_TAXEL 0xFFu /* a crossing without one */

struct electronics {
    const struct effects *effects;
    size_t board; /* index in the world */
    struct front_end *front_end;
    int tx_count, rx_count;
    uint8_t taxel_at[TAXEL_LINES_MAX][TAXEL_LINES_MAX]; /* of the electrodes, or ELECTRONICS_NO_TAXEL */
    int tx_of[TAXEL_LINES_MAX], rx_of[TAXEL_LINES_MAX]; /* the line that the firmware's line is wired to */
    uint8_t tx_at[TAXEL_TAXELS_MAX], rx_at[TAXEL_TAXELS_MAX]; /* the electrode's lines */
    double answer[TAXEL_TAXELS_MAX];    /* share of the rise that reaches the electrode */
    double rest_f[TAXEL_TAXELS_MAX];    /* farad, with the drift of this scan */
    double swing_f[TAXEL_TAXELS_MAX];   /* farad that a rise of 1 adds */
    int32_t stuck_at[TAXEL_TAXELS_MAX]; /* raw count, or -1 */
    double farad_a_count;              /* of the world's scan settings */
    bool capacitive, lines, broken, coupled, drifting, noisy, drooping;
    int filled_tx; /* the TX line for which `mutual` holds, -1 none */
    unsigned filled_fields;
    bool filled_still;
    double mutual[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
    struct coupling_lines coupling;
    struct drift_board drift;
    struct noise_board noise;
    int droop_tx; /* the TX line for which `droop` was made, -1 none */
    double droop;
    struct first_order reference, lag[TAXEL_TAXELS_MAX];
};

/* One conversion: the firmware's lines, when, and what acts then. */
struct electronics_conversion {
    int tx, rx;
    bool begins_scan;
    vtime time, powered;
    double fraction; /* between the records of `loads` */
    const struct droop_loads *loads;
    double (*rise)(const void *source, size_t taxel, vtime time);
    void (*rises)(const void *source, vtime time, double *rise); /* of all taxels of the board */
    bool still;      /* no rise changes at this time ... */
    unsigned fields; /* ... nor has since this number changed */
    const void *source;
};

/* Whether any effect asks for electronics of this board. */
bool electronics_needed(const struct world_description *world, size_t board);

/* After front_end_init() and gain_apply(). NULL without memory. */
struct electronics *electronics_open(const struct world_description *world, size_t board, struct front_end *front_end);

/* After front_end_configure(). */
void electronics_configure(struct electronics *electronics);
uint16_t electronics_convert(struct electronics *electronics, const struct electronics_conversion *conversion);

#endif
