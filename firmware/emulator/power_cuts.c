#include "emulator/power_cuts.h"

/* Return the virtual time of the next planned power cut or return of power of the hub; VTIME_NEVER if there is none. */
static vtime next_hub_power_event(const struct hub_node *hub)
{
    return vtime_min(hub->boot.flash.cut_time, hub->power_return_time);
}

/* Return the virtual time of the next planned power cut or return of power in the world; VTIME_NEVER if there is
 * none. */
vtime power_cuts_next_time(const struct world *world)
{
    vtime next = next_hub_power_event(&world->hub);
    for (size_t i = 0; i < world->board_count; i++) {
        next = vtime_min(next, board_next_power_event(&world->boards[i]));
    }
    return next;
}

/* Execute a planned power cut of the hub at virtual time `now`, or the return of its power. */
static void run_hub_power_event(struct hub_node *hub, vtime now)
{
    if (now == hub->power_return_time) {
        hub->power_return_time = VTIME_NEVER;
        hub_node_boot(hub, now, TAXEL_RESET_CAUSE_POWER_ON);
    } else {
        hub->power_return_time = now + hub->boot.flash.off_time;
        hub_node_unplug(hub, now);
    }
}

/* Execute all planned power cuts of boards and hub that are due at virtual time `now`. */
void power_cuts_run(struct world *world, vtime now)
{
    for (size_t i = 0; i < world->board_count; i++) {
        if (board_next_power_event(&world->boards[i]) <= now) {
            board_advance(&world->boards[i], now);
            board_run_power_events(&world->boards[i], now);
        }
    }
    while (next_hub_power_event(&world->hub) <= now) {
        run_hub_power_event(&world->hub, next_hub_power_event(&world->hub));
    }
}

/* Plan a power cut during a flash write of `board`, or of the hub if `board` is NULL. Returns 0, or -1 if
 * FLASH_CUTS_MAX cuts are planned. */
int world_plan_power_cut(struct world *world, struct board_node *board, const struct flash_cut_plan *plan)
{
    world->has_power_cuts = true;
    return flash_plan_cut(board ? &board->boot->flash : &world->hub.boot.flash, plan) ? 0 : -1;
}
