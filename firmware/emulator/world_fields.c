#include "emulator/world_fields.h"

/* Context of a task that runs for every board. */
struct board_task {
    struct world *world;
    vtime time;
    bool has_droop;
    bool has_failed[WORLD_BOARDS_MAX];
};

/* Call `function` once for each board number, in the threads of the pool, and wait for the end. */
static void run_for_all_boards(struct board_task *task, thread_pool_task function)
{
    thread_pool_run(task->world->thread_pool, task->world->board_count, function, task);
}

/* Simulate board number `board` up to the time of the task; task of the thread pool. */
static void advance_board(void *context, size_t board)
{
    const struct board_task *task = context;
    board_advance(&task->world->boards[board], task->time);
}

/* Advance all boards to a virtual time, in parallel if a thread pool is used. */
void world_advance_boards(struct world *world, vtime until)
{
    struct board_task task = {.world = world, .time = until};
    run_for_all_boards(&task, advance_board);
    world->boards_advanced_until = until;
}

/* Advance the board and store its fields in the history; task of one board at the end of a field interval. */
static void finish_board_field(void *context, size_t index)
{
    struct board_task *task = context;
    struct board_node *board = &task->world->boards[index];
    board_advance(board, task->time);
    task->has_failed[index] = board_fields_remember(&board->fields, task->time) != 0;
}

/* Advance the boards to `now` under the present fields, and store these fields for the boards that measure with a delay
 * (effect `late`). Returns 0, or -1 if out of memory. */
static int finish_fields(struct world *world, vtime now)
{
    struct board_task task = {.world = world, .time = now};
    run_for_all_boards(&task, finish_board_field);
    world->boards_advanced_until = now;
    for (size_t i = 0; i < world->board_count; i++) {
        if (task.has_failed[i]) {
            fprintf(stderr, "board 0x%02X: out of memory for the history of the effect 'late'\n",
                    world->description->boards[i].address);
            return -1;
        }
    }
    return 0;
}

/* Count the changes of the fields of one board. For voltage droop, also compute the board's TX load (farad) at both
 * ends of the interval. Task of one board at the start of a field interval. */
static void start_board_field(void *context, size_t index)
{
    const struct board_task *task = context;
    struct board_node *board = &task->world->boards[index];
    struct droop_loads *loads = &task->world->loads;
    const struct front_end_taxel *taxels = board->front_end.taxels;
    board_fields_update(&board->fields, task->time);
    if (task->has_droop) {
        loads->before[index] =
            board_fields_added_capacitance_f(&board->fields, false, &taxels[0].fringe_f, sizeof taxels[0]);
        loads->after[index] =
            board_fields_added_capacitance_f(&board->fields, true, &taxels[0].fringe_f, sizeof taxels[0]);
    }
}

/* Begin a new field interval for all boards at virtual time `now`, and add up their TX loads for voltage droop. */
void world_fields_start(struct world *world, vtime now)
{
    struct board_task task = {
        .world = world, .time = now, .has_droop = droop_is_on(&world->description->effects.droop)};
    struct droop_loads *loads = &world->loads;
    run_for_all_boards(&task, start_board_field);
    loads->all_before = loads->all_after = 0.0;
    for (size_t i = 0; task.has_droop && i < world->board_count; i++) {
        loads->all_before += loads->before[i];
        loads->all_after += loads->after[i];
    }
}

/* Advance the stimulus to its next record. Returns 0, or -1 after an error. */
int world_fields_next_record(struct world *world, vtime now)
{
    if (finish_fields(world, now) || stimulus_advance(world->stimulus, now)) {
        return -1;
    }
    skin_advance(&world->skin, world->stimulus);
    world_fields_start(world, now);
    return 0;
}

/* Advance the skin model by one of the time steps between two stimulus records. Returns 0, or -1 without memory. */
int world_fields_step(struct world *world, vtime now)
{
    if (finish_fields(world, now)) {
        return -1;
    }
    skin_step(&world->skin, world->stimulus);
    world_fields_start(world, now);
    return 0;
}

/* Set the stimulus to `values` now, or (NULL) to the record received from a live stimulus. Returns 0, or -1 after an
 * error. */
int world_fields_set_live(struct world *world, const float *values)
{
    struct stimulus *stimulus = world->stimulus;
    if (finish_fields(world, world->now) ||
        (values ? stimulus_set_values(stimulus, values, world->now) : stimulus_apply_live(stimulus, world->now))) {
        return -1;
    }
    skin_apply_live_record(&world->skin, stimulus, world->now);
    world_fields_start(world, world->now);
    return 0;
}
