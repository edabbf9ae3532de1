#include "emulator/base/faults.h"

#include <string.h>

static const struct {
    const char *name;
    enum fault_target target;
} fault_table[FAULT_KINDS] = {
    [FAULT_UNPLUG] = {"unplug", FAULT_TARGET_BOARD},
    [FAULT_PLUG] = {"plug", FAULT_TARGET_BOARD},
    [FAULT_RESTART] = {"restart", FAULT_TARGET_BOARD},
    [FAULT_HOLD_SDA] = {"hold_sda", FAULT_TARGET_BOARD},
    [FAULT_HOLD_SCL] = {"hold_scl", FAULT_TARGET_BOARD},
    [FAULT_STRETCH] = {"stretch", FAULT_TARGET_BOARD},
    [FAULT_CORRUPT] = {"corrupt", FAULT_TARGET_BOARD},
    [FAULT_NACK] = {"nack", FAULT_TARGET_BOARD},
    [FAULT_NACK_AT] = {"nack_at", FAULT_TARGET_TRANSFER},
    [FAULT_FLIP_AT] = {"flip_at", FAULT_TARGET_TRANSFER},
    [FAULT_STRETCH_AT] = {"stretch_at", FAULT_TARGET_TRANSFER},
    [FAULT_BROWN_OUT_AT] = {"brown_out_at", FAULT_TARGET_TRANSFER},
    [FAULT_ARBITRATION_AT] = {"arbitration_at", FAULT_TARGET_TRANSFER},
    [FAULT_BUS_ERROR_AT] = {"bus_error_at", FAULT_TARGET_TRANSFER},
    [FAULT_BRANCH_OPEN] = {"branch_open", FAULT_TARGET_BRANCH},
    [FAULT_BRANCH_SHORT_GROUND] = {"branch_short_ground", FAULT_TARGET_BRANCH},
    [FAULT_BRANCH_SHORT_SUPPLY] = {"branch_short_supply", FAULT_TARGET_BRANCH},
    [FAULT_BRANCH_RESISTANCE] = {"branch_resistance", FAULT_TARGET_BRANCH},
    [FAULT_BRANCH_RESTORE] = {"branch_restore", FAULT_TARGET_BRANCH},
    [FAULT_HUB_UNPLUG] = {"hub_unplug", FAULT_TARGET_NONE},
    [FAULT_HUB_PLUG] = {"hub_plug", FAULT_TARGET_NONE},
    [FAULT_HUB_RESTART] = {"hub_restart", FAULT_TARGET_NONE},
    [FAULT_HUB_STALL] = {"hub_stall", FAULT_TARGET_NONE},
    [FAULT_UP_FLIP] = {"up_flip", FAULT_TARGET_NONE},
    [FAULT_UP_DROP] = {"up_drop", FAULT_TARGET_NONE},
    [FAULT_UP_DOUBLE] = {"up_double", FAULT_TARGET_NONE},
    [FAULT_UP_DELAY] = {"up_delay", FAULT_TARGET_NONE},
    [FAULT_DOWN_FLIP] = {"down_flip", FAULT_TARGET_NONE},
    [FAULT_DOWN_DROP] = {"down_drop", FAULT_TARGET_NONE},
    [FAULT_DOWN_DOUBLE] = {"down_double", FAULT_TARGET_NONE},
    [FAULT_DOWN_DELAY] = {"down_delay", FAULT_TARGET_NONE},
    [FAULT_MISS_CONVERSION] = {"miss_conversion", FAULT_TARGET_BOARD},
    [FAULT_HARD_FAULT] = {"hard_fault", FAULT_TARGET_BOARD},
    [FAULT_HUB_HARD_FAULT] = {"hub_hard_fault", FAULT_TARGET_NONE},
    [FAULT_MUTE] = {"mute_host", FAULT_TARGET_NONE},
};

/* Return the kind of the fault with this name in a world file, or FAULT_KINDS if no fault has the name. */
enum fault_kind fault_find_kind(const char *name)
{
    enum fault_kind kind = FAULT_UNPLUG;
    while (kind < FAULT_KINDS && strcmp(fault_table[kind].name, name) != 0) {
        kind++;
    }
    return kind;
}

/* Return what the address of a fault of this kind denotes: a board, the branch of a board, any I2C address, or
 * nothing. */
enum fault_target fault_get_target(enum fault_kind kind)
{
    return fault_table[kind].target;
}

/* Return whether the value of a fault of a wiring branch selects lines that this fault can have: 0 the whole cable, 1
 * SCL, 2 SDA, 3 the supply. True for faults that are not faults of a branch. */
bool fault_has_valid_selection(const struct fault_description *fault)
{
    const double value = fault->value;
    const bool is_line = value == 1.0 || value == 2.0;
    switch (fault->kind) {
    case FAULT_BRANCH_OPEN:
        return is_line || value == 0.0 || value == 3.0;
    case FAULT_BRANCH_SHORT_GROUND:
    case FAULT_BRANCH_SHORT_SUPPLY:
        return is_line;
    case FAULT_BRANCH_RESISTANCE:
        return is_line || value == 0.0;
    default:
        return true;
    }
}
