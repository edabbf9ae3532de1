/* The faults that the emulator can inject, by name. World files, the virtual test rig and the fault log use the same
 * names. README.md describes each fault and its values. */
#ifndef EMULATOR_BASE_FAULTS_H
#define EMULATOR_BASE_FAULTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum fault_kind {
    /* faults of a board, effective at once */
    FAULT_UNPLUG,
    FAULT_PLUG,
    FAULT_RESTART,
    FAULT_HOLD_SDA,
    FAULT_HOLD_SCL,
    FAULT_STRETCH,
    FAULT_CORRUPT,
    FAULT_NACK,
    /* faults at one byte of the next transfer that is long enough */
    FAULT_NACK_AT,
    FAULT_FLIP_AT,
    FAULT_STRETCH_AT,
    FAULT_BROWN_OUT_AT,
    FAULT_ARBITRATION_AT,
    FAULT_BUS_ERROR_AT,
    /* faults of the hub */
    FAULT_HUB_UNPLUG,
    FAULT_HUB_PLUG,
    FAULT_HUB_RESTART,
    FAULT_HUB_STALL,
    /* faults of the UART: up is towards the host, down is towards the hub */
    FAULT_UP_FLIP,
    FAULT_UP_DROP,
    FAULT_UP_DOUBLE,
    FAULT_UP_DELAY,
    FAULT_DOWN_FLIP,
    FAULT_DOWN_DROP,
    FAULT_DOWN_DOUBLE,
    FAULT_DOWN_DELAY,
    /* fault of the host */
    FAULT_MUTE,
    /* faults of a branch of the wiring */
    FAULT_BRANCH_OPEN,
    FAULT_BRANCH_SHORT_GROUND,
    FAULT_BRANCH_SHORT_SUPPLY,
    FAULT_BRANCH_RESISTANCE,
    FAULT_BRANCH_RESTORE,
    /* faults of the firmware of a board or of the hub, which its watchdog ends */
    FAULT_MISS_CONVERSION,
    FAULT_HARD_FAULT,
    FAULT_HUB_HARD_FAULT,
    FAULT_KINDS,
};

/* The meaning of the address of a fault. */
enum fault_target {
    FAULT_TARGET_BOARD,    /* a board of the world */
    FAULT_TARGET_BRANCH,   /* a board; the fault acts on the branch of the wiring that contains the board */
    FAULT_TARGET_TRANSFER, /* any I2C address, with or without a board; 0 is every address */
    FAULT_TARGET_NONE,     /* no address; it is 0 */
};

struct fault_description {
    double time_s;
    enum fault_kind kind;
    uint8_t address;
    double value, second_value; /* meaning and units depend on the kind (README.md) */
};

/* Return the kind of the fault with this name, or FAULT_KINDS for an unknown name. */
enum fault_kind fault_find_kind(const char *name);

/* Return the meaning of the address of faults of this kind. */
enum fault_target fault_get_target(enum fault_kind kind);

/* Return whether `value` is permitted for a fault of a branch, where it selects the line; true for other faults. */
bool fault_has_valid_selection(const struct fault_description *fault);

#endif
