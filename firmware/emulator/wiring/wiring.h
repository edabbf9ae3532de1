/* Description of the wiring between hub and boards: a star of branches on one I2C bus. */
#ifndef EMULATOR_WIRING_WIRING_H
#define EMULATOR_WIRING_WIRING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define WIRING_BRANCHES_MAX 16u
#define WIRING_NAME_SIZE 32u /* with terminator */
#define WIRING_ADDRESSES 128u

#define WIRING_HUB_CAPACITANCE_PF 10.0 /* pin of the hub's processor: at most 7 pF (data sheet of the PSoC 4200); pad */

struct branch_description {
    char name[WIRING_NAME_SIZE];
    double pullup_ohm;     /* from each line to the supply, at the boards; 0: none */
    double capacitance_pf; /* of each line: cable and boards */
    double series_ohm;     /* of each line, between hub and boards */
};

struct wiring_description {
    bool is_buffered;      /* a buffer separates each branch from the hub; otherwise the branches are connected */
    double hub_pullup_ohm; /* 0: none */
    double hub_capacitance_pf;
    struct branch_description branches[WIRING_BRANCHES_MAX];
    size_t branch_count;                 /* 0: an ideal bus */
    uint8_t branch_of[WIRING_ADDRESSES]; /* by I2C address: number of the branch from 1, or 0: at the hub */
};

#endif
