/* Injects faults: faults of boards, hub and host take effect at once, faults at a byte are passed to bus and UART. */
#include "emulator/world.h"

/* Return whether the open supply of a branch keeps a board without power. */
static bool has_open_supply(const struct world *world, const struct board_node *board)
{
    const int branch = bus_wiring_find_branch(&world->bus.wiring, board->description->address);
    return branch >= 0 && world->bus.wiring.is_supply_open[branch];
}

/* Apply a fault to one board, which is first advanced to the current time. The value of the fault is a number of
 * clocks, microseconds, bytes or NACKs, depending on its kind. A board without supply cannot be plugged in or
 * restarted. */
static void apply_to_board(struct world *world, struct board_node *board, const struct fault_description *fault)
{
    const vtime now = world->now;
    board_advance(board, now);
    if ((fault->kind == FAULT_PLUG || fault->kind == FAULT_RESTART) && has_open_supply(world, board)) {
        return;
    }
    switch (fault->kind) {
    case FAULT_UNPLUG:
        board_set_power(board, false, now, TAXEL_RESET_CAUSE_POWER_ON);
        break;
    case FAULT_PLUG:
        board_set_power(board, true, now, TAXEL_RESET_CAUSE_POWER_ON);
        break;
    case FAULT_RESTART:
        board_set_power(board, false, now, TAXEL_RESET_CAUSE_BROWN_OUT);
        board_set_power(board, true, now, TAXEL_RESET_CAUSE_BROWN_OUT);
        break;
    case FAULT_MISS_CONVERSION:
        board_lose_conversion(board, now);
        break;
    case FAULT_HARD_FAULT:
        board_take_hard_fault(board, now, (uint32_t)fault->value, (uint32_t)fault->second_value);
        break;
    case FAULT_HOLD_SDA:
        board->sda_hold_clocks = (unsigned)fault->value;
        world->bus.lines_may_be_held = true;
        break;
    case FAULT_HOLD_SCL:
        board->scl_held_until = now + (vtime)(fault->value * (double)VTIME_US);
        world->bus.lines_may_be_held = true;
        break;
    case FAULT_STRETCH:
        board->address_stretch = (vtime)(fault->value * (double)VTIME_US);
        break;
    case FAULT_CORRUPT:
        board->corrupt_bytes_left = (unsigned)fault->value;
        break;
    default:
        board->nacks_left = (unsigned)fault->value;
        break;
    }
}

/* Apply a fault to the branch that contains the board with the fault's address: to the lines of the branch and, for an
 * open or a restored supply, to the power of its boards. Returns 0, or -1 if there is no such branch or if the value of
 * the fault selects a line that this kind of fault cannot affect. */
static int apply_to_branch(struct world *world, const struct fault_description *fault)
{
    struct bus_wiring *wiring = &world->bus.wiring;
    const int branch = bus_wiring_find_branch(wiring, fault->address);
    if (branch < 0 || !fault_has_valid_selection(fault)) {
        return -1;
    }
    const bool was_open = wiring->is_supply_open[branch];
    bus_wiring_apply_fault(wiring, (size_t)branch, fault);
    const bool is_open = wiring->is_supply_open[branch];
    for (size_t i = 0; is_open != was_open && i < world->board_count; i++) {
        struct board_node *board = &world->boards[i];
        if (bus_wiring_find_branch(wiring, board->description->address) == branch) {
            board_advance(board, world->now);
            board_set_power(board, !is_open, world->now, TAXEL_RESET_CAUSE_POWER_ON);
        }
    }
    return 0;
}

/* Apply a fault of the hub, the UART, the bus, or the endpoint (the connection to a host program). Returns 0, or -1 if
 * too many faults are pending. */
static int apply_fault(struct world *world, const struct fault_description *fault)
{
    const vtime now = world->now;
    switch (fault->kind) {
    case FAULT_HUB_UNPLUG:
        hub_node_unplug(&world->hub, now);
        return 0;
    case FAULT_HUB_PLUG:
        hub_node_boot(&world->hub, now, TAXEL_RESET_CAUSE_POWER_ON);
        return 0;
    case FAULT_HUB_RESTART:
        hub_node_boot(&world->hub, now, TAXEL_RESET_CAUSE_BROWN_OUT);
        return 0;
    case FAULT_HUB_HARD_FAULT:
        hub_node_take_hard_fault(&world->hub, now, (uint32_t)fault->value, (uint32_t)fault->second_value);
        return 0;
    case FAULT_HUB_STALL:
        hub_node_stall(&world->hub, now + (vtime)(fault->value * (double)VTIME_MS));
        return 0;
    case FAULT_UP_FLIP:
    case FAULT_UP_DROP:
    case FAULT_UP_DOUBLE:
    case FAULT_UP_DELAY:
        return uart_faults_add(&world->uart.to_host_faults, fault, now) ? 0 : -1;
    case FAULT_DOWN_FLIP:
    case FAULT_DOWN_DROP:
    case FAULT_DOWN_DOUBLE:
    case FAULT_DOWN_DELAY:
        return uart_faults_add(&world->uart.to_hub_faults, fault, now) ? 0 : -1;
    case FAULT_MUTE:
        world->endpoint->is_muted = fault->value != 0.0;
        return 0;
    default:
        return bus_faults_add(&world->bus.faults, fault) ? 0 : -1;
    }
}

/* Apply a fault now and log it. Returns 0, or -1 if too many faults are pending, or if a fault of a branch is
 * invalid. */
int world_inject_fault(struct world *world, const struct fault_description *fault)
{
    fault_log_add(&world->log, world->now, fault->kind, fault->address);
    if (fault_get_target(fault->kind) == FAULT_TARGET_BRANCH) {
        return apply_to_branch(world, fault);
    }
    if (fault_get_target(fault->kind) != FAULT_TARGET_BOARD) {
        return apply_fault(world, fault);
    }
    for (size_t i = 0; i < world->board_count; i++) {
        if (world->boards[i].description->address == fault->address) {
            apply_to_board(world, &world->boards[i], fault);
        }
    }
    return 0;
}
