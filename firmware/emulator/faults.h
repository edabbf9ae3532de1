/* What goes wrong, by name: the same names in a world file, in a rig and in a log of what struck. */
#ifndef EMULATOR_FAULTS_H
#define EMULATOR_FAULTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum fault_kind {
    /* a board, at once */
    FAULT_UNPLUG,
    FAULT_PLUG,
    FAULT_RESTART,
    FAULT_HOLD_SDA,
    FAULT_HOLD_SCL,
    FAULT_STRETCH,
    FAULT_CORRUPT,
    FAULT_NACK,
    /* a byte of the next transfer with a board that has that many bytes */
    FAULT_NACK_AT,
    FAULT_FLIP_AT,
    FAULT_STRETCH_AT,
    FAULT_BROWN_OUT_AT,
    FAULT_ARBITRATION_AT,
    FAULT_BUS_ERROR_AT,
    /* the hub */
    FAULT_HUB_UNPLUG,
    FAULT_HUB_PLUG,
    FAULT_HUB_RESTART,
    FAULT_HUB_STALL,
    /* the UART, up to the host and down to the hub */
    FAULT_UP_FLIP,
    FAULT_UP_DROP,
    FAULT_UP_DOUBLE,
    FAULT_UP_DELAY,
    FAULT_DOWN_FLIP,
    FAULT_DOWN_DROP,
    FAULT_DOWN_DOUBLE,
    FAULT_DOWN_DELAY,
    /* the host */
    FAULT_MUTE,
    FAULT_KINDS,
};

/* Whom a fault strikes: it says what its address means. */
enum fault_target {
    FAULT_TARGET_BOARD,    /* a board of the world */
    FAULT_TARGET_TRANSFER, /* whoever is addressed: a board or not; 0 stands for every address */
    FAULT_TARGET_NONE,     /* the address is 0 */
};

struct fault_description {
    double time_s;
    enum fault_kind kind;
    uint8_t address;
    double value, second; /* what they mean is the kind's: README.md */
};

/* FAULT_KINDS for an unknown name. */
enum fault_kind fault_named(const char *name);
const char *fault_name(enum fault_kind kind);
enum fault_target fault_target_of(enum fault_kind kind);

#endif
