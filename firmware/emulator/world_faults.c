/* What a fault does at the moment it strikes; those that wait for a byte or a frame are handed to bus and UART. */
#include "emulator/world.h"

static void strike_board(struct world *world, struct board_node *board, const struct fault_description *fault)
{
    const vtime now = world->now;
    board_advance(board, now);
    switch (fault->kind) {
    case FAULT_UNPLUG:
        board_power(board, false, now, TAXEL_RESET_CAUSE_POWER_ON);
        break;
    case FAULT_PLUG:
        board_power(board, true, now, TAXEL_RESET_CAUSE_POWER_ON);
        break;
    case FAULT_RESTART:
        board_power(board, false, now, TAXEL_RESET_CAUSE_BROWN_OUT);
        board_power(board, true, now, TAXEL_RESET_CAUSE_BROWN_OUT);
        break;
    case FAULT_HOLD_SDA:
        board->hold_clocks = (unsigned)fault->value;
        world->bus.may_be_held = true;
        break;
    case FAULT_HOLD_SCL:
        board->scl_held_until = now + (vtime)(fault->value * (double)VTIME_US);
        world->bus.may_be_held = true;
        break;
    case FAULT_STRETCH:
        board->stretch = (vtime)(fault->value * (double)VTIME_US);
        break;
    case FAULT_CORRUPT:
        board->corrupt_bytes = (unsigned)fault->value;
        break;
    default:
        board->nacks = (unsigned)fault->value;
        break;
    }
}

static int strike(struct world *world, const struct fault_description *fault)
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
    case FAULT_HUB_STALL:
        hub_node_stall(&world->hub, now + (vtime)(fault->value * (double)VTIME_MS));
        return 0;
    case FAULT_UP_FLIP:
    case FAULT_UP_DROP:
    case FAULT_UP_DOUBLE:
    case FAULT_UP_DELAY:
        return line_faults_add(&world->uart.up, fault, now) ? 0 : -1;
    case FAULT_DOWN_FLIP:
    case FAULT_DOWN_DROP:
    case FAULT_DOWN_DOUBLE:
    case FAULT_DOWN_DELAY:
        return line_faults_add(&world->uart.down, fault, now) ? 0 : -1;
    case FAULT_MUTE:
        world->endpoint->muted = fault->value != 0.0;
        return 0;
    default:
        return bus_faults_add(&world->bus.faults, fault) ? 0 : -1;
    }
}

int world_inject(struct world *world, const struct fault_description *fault)
{
    fault_log_add(&world->log, world->now, fault->kind, fault->address);
    if (fault_target_of(fault->kind) != FAULT_TARGET_BOARD) {
        return strike(world, fault);
    }
    for (size_t i = 0; i < world->board_count; i++) {
        if (world->boards[i].description->address == fault->address) {
            strike_board(world, &world->boards[i], fault);
        }
    }
    return 0;
}
