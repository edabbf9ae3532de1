/* The electronics of a board that is not ideal: the path from capacitance to raw count, with each effect at its
 * position.
 *
 *   rises -> capacitances (drift, dead, exchanged, broken and joined lines) -> network of the lines
 *   -> supply and reference -> low pass -> noise -> saturation -> converter -> quantisation -> stuck bits
 *
 * A board without any of these effects has no `struct electronics`: front_end_convert() computes its counts. */
#ifndef EMULATOR_ELECTRONICS_H
#define EMULATOR_ELECTRONICS_H

#include "emulator/effects/coupling.h"
#include "emulator/effects/drift.h"
#include "emulator/effects/droop.h"
#include "emulator/effects/noise.h"
#include "emulator/physics/front_end.h"
#include "emulator/world_file/world_file.h"

#define ELECTRONICS_NO_TAXEL 0xFFu /* a crossing without taxel */

/* Electronics of one board. "Electrode lines" are the lines of the sensor; a line of the firmware is wired to another
 * electrode line if the effect `exchange` swaps lines. */
struct electronics {
    const struct effects *effects;
    size_t board; /* index in the world */
    struct front_end *front_end;
    int tx_count, rx_count;
    /* taxel at a crossing of electrode lines, or ELECTRONICS_NO_TAXEL */
    uint8_t taxel_at[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
    int tx_of[TAXEL_LINES_MAX], rx_of[TAXEL_LINES_MAX];       /* electrode line that the firmware's line is wired to */
    uint8_t tx_at[TAXEL_TAXELS_MAX], rx_at[TAXEL_TAXELS_MAX]; /* electrode lines of each taxel */
    /* share of the relative rise under contact that reaches the electrode (effect `dead`) */
    double sensitivity[TAXEL_TAXELS_MAX];
    double rest_f[TAXEL_TAXELS_MAX];       /* capacitance without contact (farad), with the drift of this scan */
    double swing_f[TAXEL_TAXELS_MAX];      /* capacitance (farad) that a rise of 1 adds */
    int32_t stuck_count[TAXEL_TAXELS_MAX]; /* raw count of a stuck taxel, or -1 */
    double farad_per_count;                /* under the scan settings of the world */
    bool uses_capacitances;                /* capacitances must be computed, not only relative rises */
    bool couples_crossings;                /* a count depends on other crossings too */
    bool has_line_faults, has_coupling, has_drift, has_noise, has_droop;

    /* Cached capacitances of all crossings (farad), [tx][rx]. */
    double mutual[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
    int mutual_tx; /* the TX line for which they were computed; -1: none */
    unsigned mutual_change_count;
    bool mutual_is_constant;

    struct coupling_lines coupling;
    struct drift_board drift;
    struct noise_board noise;
    int droop_tx; /* the TX line for which `droop` was computed; -1: none */
    double droop;
    struct first_order reference, lag[TAXEL_TAXELS_MAX];
};

/* One conversion: the TX and RX line that the firmware selects, the time, and access to the relative rises of the
 * taxels' fringe capacitances at that time. */
struct electronics_conversion {
    int tx, rx;
    bool is_first_of_scan;
    vtime time, power_on_time;
    double fraction; /* interpolation weight between the two records of `loads` */
    const struct droop_loads *loads;
    double (*get_rise)(const void *context, size_t taxel, vtime time);
    void (*get_all_rises)(const void *context, vtime time, double *rise); /* of all taxels of the board */
    const void *rise_context;
    bool fields_are_constant; /* no field changes around this time */
    unsigned change_count;    /* of the fields: equal to an earlier value if no field has changed since then */
};

/* Return whether any effect of the world requires a `struct electronics` for board number `board`. */
bool electronics_are_needed(const struct world_description *world, size_t board);

/* Create the electronics of a board. Call after front_end_init() and gain_apply(). Returns NULL if out of memory. */
struct electronics *electronics_open(const struct world_description *world, size_t board, struct front_end *front_end);

/* Update everything that depends on the scan settings. Call after each change of the front end's settings. */
void electronics_configure(struct electronics *electronics);

/* Return the raw count of one conversion. */
uint16_t electronics_convert(struct electronics *electronics, const struct electronics_conversion *conversion);

#endif
