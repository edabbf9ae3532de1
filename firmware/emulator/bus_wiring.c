#include "emulator/bus_wiring.h"

#include <math.h>
#include <string.h>

#define WIRING_STREAM 0x5741u /* random numbers of the wiring */

/* Selections of the value of a fault of a branch. */
enum {
    SELECT_ALL = 0,
    SELECT_SCL = 1,
    SELECT_SDA = 2,
    SELECT_SUPPLY = 3,
};

/* Return the longer rise time (seconds) of SCL and SDA at the hub (number 0), or at the boards of a branch (number from
 * 1). */
static double find_rise_s(const struct bus_wiring *wiring, size_t number)
{
    const struct star *scl = &wiring->stars[WIRING_SCL], *sda = &wiring->stars[WIRING_SDA];
    return number ? fmax(scl->branches[number - 1u].rise_s, sda->branches[number - 1u].rise_s)
                  : fmax(scl->hub_rise_s, sda->hub_rise_s);
}

/* Return whether the levels of hub and boards reach each other on one line (SCL or SDA). number: 0 for boards directly
 * at the hub, otherwise the number of their branch, from 1. */
static bool line_connects(const struct star *star, size_t number)
{
    if (!star->is_high || !star->can_be_low) {
        return false;
    }
    const struct star_branch *levels = &star->branches[number ? number - 1u : 0u];
    return !number || (levels->is_high && levels->hub_lows_arrive && levels->board_lows_arrive);
}

/* Recompute levels, rise times and probabilities of misread bits after a change of the faults. Index 0 of the results
 * is for the boards at the hub, index i for the boards of branch i. */
static void solve(struct bus_wiring *wiring)
{
    for (size_t line = 0; line < WIRING_LINES; line++) {
        star_solve(&wiring->stars[line], wiring->description, wiring->faults[line]);
    }
    for (size_t i = 0; i <= wiring->description->branch_count; i++) {
        const double at_board_s = find_rise_s(wiring, i), at_hub_s = find_rise_s(wiring, 0);
        /* a buffer reads the line of its branch before it drives the hub's line */
        const double read_s = wiring->description->is_buffered ? fmax(at_hub_s, at_board_s) : at_hub_s;
        wiring->connects[i] =
            line_connects(&wiring->stars[WIRING_SCL], i) && line_connects(&wiring->stars[WIRING_SDA], i);
        wiring->misread_at_board[i] = star_misread_probability(at_board_s, wiring->scl_hz);
        wiring->misread_at_hub[i] = star_misread_probability(read_s, wiring->scl_hz);
    }
}

/* Initialise the wiring of a bus. A description without branches is an ideal bus. */
void bus_wiring_init(struct bus_wiring *wiring, const struct wiring_description *description, double scl_hz,
                     uint64_t seed)
{
    memset(wiring, 0, sizeof *wiring);
    if (!description->branch_count) {
        return;
    }
    wiring->description = description;
    wiring->scl_hz = scl_hz;
    random_init(&wiring->random, seed, WIRING_STREAM);
    solve(wiring);
}

/* Apply a fault to one line (SCL or SDA) of a branch: an open line, a short, or otherwise an added series resistance.
 * second_value of the fault: resistance in ohm. */
static void apply_to_line(struct line_fault *line, const struct fault_description *fault)
{
    switch (fault->kind) {
    case FAULT_BRANCH_OPEN:
        line->is_open = true;
        break;
    case FAULT_BRANCH_SHORT_GROUND:
        line->has_short_to_ground = true;
        line->to_ground = fault->second_value;
        break;
    case FAULT_BRANCH_SHORT_SUPPLY:
        line->has_short_to_supply = true;
        line->to_supply = fault->second_value;
        break;
    default:
        line->added_series = fault->second_value;
        break;
    }
}

/* Apply a fault of a branch, or end all its faults (FAULT_BRANCH_RESTORE), and recompute levels and rise times. */
void bus_wiring_apply_fault(struct bus_wiring *wiring, size_t branch, const struct fault_description *fault)
{
    const unsigned selection = (unsigned)fault->value;
    if (fault->kind == FAULT_BRANCH_RESTORE) {
        wiring->faults[WIRING_SCL][branch] = wiring->faults[WIRING_SDA][branch] = (struct line_fault){.is_open = false};
        wiring->is_supply_open[branch] = false;
    } else {
        if (selection == SELECT_ALL || selection == SELECT_SCL) {
            apply_to_line(&wiring->faults[WIRING_SCL][branch], fault);
        }
        if (selection == SELECT_ALL || selection == SELECT_SDA) {
            apply_to_line(&wiring->faults[WIRING_SDA][branch], fault);
        }
        if (fault->kind == FAULT_BRANCH_OPEN && (selection == SELECT_ALL || selection == SELECT_SUPPLY)) {
            wiring->is_supply_open[branch] = true;
        }
    }
    solve(wiring);
}

/* Return a byte in which each 1 that follows a 0 is misread as 0 with this probability, because the line rises slowly.
 * Also counts the misread bits. The bit before the byte is a 0: start condition or acknowledge. number: 0 for boards
 * directly at the hub, otherwise the number of the branch from 1. */
static uint8_t apply_misreads(struct bus_wiring *wiring, size_t number, double probability, uint8_t byte)
{
    uint8_t received = byte;
    for (unsigned mask = 0x80u, previous = 0u; mask; previous = byte & mask, mask >>= 1) {
        if ((byte & mask) && !previous && random_uniform(&wiring->random) < probability) {
            received &= (uint8_t)~mask;
            wiring->misread_bits[number]++;
        }
    }
    return received;
}

/* Return the byte that the board receives if the hub sends `byte`. */
uint8_t bus_wiring_deliver_to_board(struct bus_wiring *wiring, uint8_t address, uint8_t byte)
{
    const size_t number = wiring->description ? wiring->description->branch_of[address] : 0u;
    const double probability = wiring->misread_at_board[number];
    return probability > 0.0 ? apply_misreads(wiring, number, probability, byte) : byte;
}

/* Return the byte that the hub receives if the board sends `byte`. */
uint8_t bus_wiring_deliver_to_hub(struct bus_wiring *wiring, uint8_t address, uint8_t byte)
{
    const size_t number = wiring->description ? wiring->description->branch_of[address] : 0u;
    const double probability = wiring->misread_at_hub[number];
    return probability > 0.0 ? apply_misreads(wiring, number, probability, byte) : byte;
}
