/* Levels and rise times of one line (SCL or SDA) of a star of branches.
 *
 * The line is a network of resistors and capacitors: the hub's node, and one node for the boards of each branch. The
 * rise time is the time from 30 % to 70 % of the supply after every driver has released the line (definition of
 * NXP UM10204, rev. 7, section 6). Without series resistance it equals ln(7/3) R C = 0.8473 R C, with the parallel
 * pull-ups R and the sum of the capacitances C (UM10204, section 7.1). */
#ifndef EMULATOR_WIRING_STAR_H
#define EMULATOR_WIRING_STAR_H

#include "emulator/wiring/wiring.h"

#define STAR_LOW_LEVEL 0.3  /* highest low level of an input, share of the supply (UM10204, table 10) */
#define STAR_HIGH_LEVEL 0.7 /* lowest high level of an input, share of the supply (UM10204, table 10) */

/* Resistance of a driver that pulls a line low: 0.4 V at 3 mA (UM10204, table 10: V_OL1, I_OL). */
#define STAR_DRIVER_OHM 133.0

/* Faults of one line of a branch. Resistances in ohms. */
struct line_fault {
    bool is_open;
    double added_series;
    bool has_short_to_ground, has_short_to_supply;
    double to_ground, to_supply;
};

/* The line between hub and the boards of one branch. */
struct star_branch {
    double rise_s;          /* at the boards; INFINITY: the line does not become high */
    bool is_high;           /* the boards read a released line as high */
    bool hub_lows_arrive;   /* the boards read the line as low while the hub pulls it low */
    bool board_lows_arrive; /* the hub reads the line as low while a board of the branch pulls it low */
};

struct star {
    double hub_rise_s; /* at the hub; INFINITY: the line does not become high */
    bool is_high;      /* the hub reads a released line as high */
    bool can_be_low;   /* the hub reads the line as low while it pulls the line low itself */
    struct star_branch branches[WIRING_BRANCHES_MAX];
};

/* Compute levels and rise times of one line of the star. faults: one for each branch. */
void star_solve(struct star *star, const struct wiring_description *wiring, const struct line_fault *faults);

/* Return the largest rise time at this clock rate, seconds, of the slowest I2C mode that permits the rate: 1000 ns up
 * to 100 kHz, 300 ns up to 400 kHz, 120 ns up to 1 MHz (UM10204, table 11). Above 1 MHz the limit falls with the rate
 * (assumed). */
double star_rise_limit_s(double scl_hz);

/* Return the probability that a receiver misreads a bit that rises from 0 to 1. It is 0 up to the limit. The excess
 * over the limit shortens the set-up time of the data, t_SU;DAT (250, 100 or 50 ns); the probability is the lost share
 * of the set-up time (assumed), so that all rising bits are misread once no set-up time is left. */
double star_misread_probability(double rise_s, double scl_hz);

#endif
