#include "emulator/power_cuts.h"

static vtime hub_event(const struct hub_node *hub)
{
    return vtime_min(hub->boot.flash.cut_at, hub->power_back_at);
}

vtime power_cuts_next(const struct world *world)
{
    vtime next = hub_event(&world->hub);
    for (size_t i = 0; i < world->board_count; i++) {
        next = vtime_min(next, board_power_event(&world->boards[i]));
    }
    return next;
}

static void cut_hub(struct hub_node *hub, vtime now)
{
    if (now == hub->power_back_at) {
        hub->power_back_at = VTIME_NEVER;
        hub_node_boot(hub, now, TAXEL_RESET_CAUSE_POWER_ON);
    } else {
        hub->power_back_at = now + hub->boot.flash.off;
        hub_node_unplug(hub, now);
    }
}

void power_cuts_make(struct world *world, vtime now)
{
    for (size_t i = 0; i < world->board_count; i++) {
        if (board_power_event(&world->boards[i]) <= now) {
            board_advance(&world->boards[i], now);
            board_power_events(&world->boards[i], now);
        }
    }
    while (hub_event(&world->hub) <= now) {
        cut_hub(&world->hub, hub_event(&world->hub));
    }
}

int world_plan_power_cut(struct world *world, struct board_node *board, const struct flash_cut_plan *plan)
{
    world->has_power_cuts = true;
    return flash_plan_cut(board ? &board->boot->flash : &world->hub.boot.flash, plan) ? 0 : -1;
}
