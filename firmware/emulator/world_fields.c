#include "emulator/world_fields.h"

struct moment {
    struct world *world;
    vtime time;
    bool drooping;
    bool failed[WORLD_BOARDS_MAX];
};

static void share(struct moment *moment, thread_pool_task work)
{
    thread_pool_run(moment->world->thread_pool, moment->world->board_count, work, moment);
}

static void advance_board(void *context, size_t item)
{
    const struct moment *moment = context;
    board_advance(&moment->world->boards[item], moment->time);
}

void world_boards_advance(struct world *world, vtime until)
{
    struct moment moment = {.world = world, .time = until};
    share(&moment, advance_board);
    world->shared = until;
}

static void leave_field(void *context, size_t item)
{
    struct moment *moment = context;
    struct board_node *board = &moment->world->boards[item];
    board_advance(board, moment->time);
    moment->failed[item] = board_fields_leave(&board->fields, moment->time) != 0;
}

/* The boards measure up to now with what was, and remember it where they must. */
static int leave_fields(struct world *world, vtime now)
{
    struct moment moment = {.world = world, .time = now};
    share(&moment, leave_field);
    world->shared = now;
    for (size_t i = 0; i < world->board_count; i++) {
        if (moment.failed[i]) {
            fprintf(stderr, "board 0x%02X: out of memory\n", world->description->boards[i].address);
            return -1;
        }
    }
    return 0;
}

static void enter_field(void *context, size_t item)
{
    const struct moment *moment = context;
    struct board_node *board = &moment->world->boards[item];
    struct droop_loads *loads = &moment->world->loads;
    const struct front_end_taxel *taxels = board->front_end.taxels;
    board_fields_enter(&board->fields, moment->time);
    if (moment->drooping) {
        loads->before[item] = board_fields_load(&board->fields, false, &taxels[0].fringe_f, sizeof taxels[0]);
        loads->after[item] = board_fields_load(&board->fields, true, &taxels[0].fringe_f, sizeof taxels[0]);
    }
}

void world_fields_enter(struct world *world, vtime now)
{
    struct moment moment = {.world = world, .time = now, .drooping = droop_is_on(&world->description->effects.droop)};
    struct droop_loads *loads = &world->loads;
    share(&moment, enter_field);
    loads->all_before = loads->all_after = 0.0;
    for (size_t i = 0; moment.drooping && i < world->board_count; i++) {
        loads->all_before += loads->before[i];
        loads->all_after += loads->after[i];
    }
}

int world_fields_next(struct world *world, vtime now)
{
    if (leave_fields(world, now) || stimulus_advance(world->stimulus, now)) {
        return -1;
    }
    skin_advance(&world->skin, world->stimulus);
    world_fields_enter(world, now);
    return 0;
}

int world_fields_step(struct world *world, vtime now)
{
    if (leave_fields(world, now)) {
        return -1;
    }
    skin_step(&world->skin, world->stimulus);
    world_fields_enter(world, now);
    return 0;
}

/* Between two records the fields stand still; then the boards measure with the new ones. */
int world_fields_live(struct world *world, const float *values)
{
    struct stimulus *stimulus = world->stimulus;
    if (leave_fields(world, world->now) ||
        (values ? stimulus_set(stimulus, values, world->now) : stimulus_take_live(stimulus, world->now))) {
        return -1;
    }
    skin_take_live(&world->skin, stimulus, world->now);
    world_fields_enter(world, world->now);
    return 0;
}
