/* The wiring of the bus as a star of branches: which boards the hub reaches, which line stays low, which bits are
 * misread. */
#ifndef EMULATOR_BUS_WIRING_H
#define EMULATOR_BUS_WIRING_H

#include "emulator/base/faults.h"
#include "emulator/base/random.h"
#include "emulator/wiring/star.h"

enum wiring_line {
    WIRING_SCL,
    WIRING_SDA,
    WIRING_LINES,
};

struct bus_wiring {
    const struct wiring_description *description;
    double scl_hz;
    struct line_fault faults[WIRING_LINES][WIRING_BRANCHES_MAX];
    bool is_supply_open[WIRING_BRANCHES_MAX];
    struct star stars[WIRING_LINES];
    /* by number of the branch from 1; 0: boards at the hub */
    bool connects[WIRING_BRANCHES_MAX + 1u];
    double misread_at_board[WIRING_BRANCHES_MAX + 1u], misread_at_hub[WIRING_BRANCHES_MAX + 1u]; /* probabilities */
    struct random_source random;
    uint64_t misread_bits[WIRING_BRANCHES_MAX + 1u];
};

void bus_wiring_init(struct bus_wiring *wiring, const struct wiring_description *description, double scl_hz,
                     uint64_t seed);

/* Return the number of the branch of an I2C address from 0; -1: the board is connected at the hub. */
static inline int bus_wiring_find_branch(const struct bus_wiring *wiring, uint8_t address)
{
    return wiring->description ? (int)wiring->description->branch_of[address] - 1 : -1;
}

/* Apply a fault of a branch (base/faults.h) to lines and supply. */
void bus_wiring_apply_fault(struct bus_wiring *wiring, size_t branch, const struct fault_description *fault);

/* Return whether a line reads low at the hub although every driver has released it. */
static inline bool bus_wiring_is_low(const struct bus_wiring *wiring, enum wiring_line line)
{
    return wiring->description && !wiring->stars[line].is_high;
}

/* Return whether the levels of hub and board reach each other on both lines. */
static inline bool bus_wiring_connects(const struct bus_wiring *wiring, uint8_t address)
{
    return !wiring->description || wiring->connects[wiring->description->branch_of[address]];
}

/* Return the byte that a board receives from the hub, or that the hub receives from a board: rising bits may be misread
 * as 0 if the rise time exceeds the limit of the clock rate. */
uint8_t bus_wiring_deliver_to_board(struct bus_wiring *wiring, uint8_t address, uint8_t byte);
uint8_t bus_wiring_deliver_to_hub(struct bus_wiring *wiring, uint8_t address, uint8_t byte);

#endif
