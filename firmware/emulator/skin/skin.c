#include "emulator/skin/skin.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/skin/board_load.h"

#define FIRST_STEP (10u * VTIME_MS)
#define LIVE_STEP (20u * VTIME_MS) /* the time of the next live record is unknown */
#define LAST_STEP VTIME_SECOND

static const struct field_moment initial_moment = {0.0, 0.0, 0.0, false};

/* Build the cells, the two loads and the field state of one board, and compute its fields at rest. Returns 0, or -1 if
 * out of memory. */
static int init_board(struct skin_board *board, const struct world_description *description, size_t index)
{
    const struct board_description *sheet = &description->boards[index];
    if (patch_init(&board->patch, sheet->rows, sheet->columns, sheet->crossing_map, sheet->taxel_count,
                   sheet->taxel_poses) ||
        patch_add_margins(&board->patch, sheet->margin_count, sheet->margin_poses) ||
        field_load_init(&board->loads[0], &board->patch) || field_load_init(&board->loads[1], &board->patch) ||
        field_init(&board->field, description, index, &board->patch)) {
        return -1;
    }
    const size_t cells = board->patch.cell_count, taxels = board->patch.taxel_count;
    board->before = malloc(taxels * sizeof *board->before);
    board->after = malloc(taxels * sizeof *board->after);
    board->compression = calloc(cells, sizeof *board->compression);
    if (!board->before || !board->after || !board->compression) {
        return -1;
    }
    field_advance(&board->field, &board->loads[0], &board->loads[1], &initial_moment, board->after);
    memcpy(board->before, board->after, taxels * sizeof *board->before);
    return 0;
}

/* Return whether the world file states the pose of every taxel, which a scene needs. */
static bool is_placed(const struct world_description *description)
{
    for (size_t i = 0; i < description->board_count; i++) {
        if (!description->boards[i].taxel_pose_count) {
            return false;
        }
    }
    return true;
}

/* Check that a stimulus of poses fits the world: taxels have poses, and each record has one bracket pose per board.
 * Returns 0, or -1 after an error line on stderr. */
static int check_scene(const struct world_description *description, const struct stimulus *stimulus)
{
    if (!is_placed(description)) {
        fprintf(stderr, "stimulus %s: contains poses, expected a world with the pose of every taxel (surface lines)\n",
                stimulus->name);
        return -1;
    }
    if (stimulus->value_count != STIMULUS_SCENE_VALUES(description->board_count)) {
        fprintf(stderr, "stimulus %s: expected poses of %zu boards, as in the world; found another number\n",
                stimulus->name, description->board_count);
        return -1;
    }
    return 0;
}

/* Build the skins of all boards and apply the first record of the stimulus. No skin is built (`boards` stays NULL) if
 * the stimulus consists of raw counts, or of forces while no skin effect is active: these act on the front ends
 * directly. Returns 0, or -1 after an error line on stderr. */
int skin_init(struct skin *skin, const struct world_description *description, const struct stimulus *stimulus)
{
    memset(skin, 0, sizeof *skin);
    skin->description = description;
    skin->board_count = description->board_count;
    skin->next = VTIME_NEVER;
    skin->until = VTIME_NEVER;
    skin->is_dynamic = field_effects_are_dynamic(&description->effects);
    const bool scene = stimulus->kind == STIMULUS_SCENE;
    if (!scene && (stimulus->kind == STIMULUS_COUNTS || !field_effects_are_on(&description->effects))) {
        return 0;
    }
    if (scene && check_scene(description, stimulus)) {
        return -1;
    }
    skin->boards = calloc(skin->board_count, sizeof *skin->boards);
    for (size_t i = 0, taxels = 0; skin->boards && i < skin->board_count; i++) {
        skin->boards[i].first_taxel = taxels;
        taxels += description->boards[i].taxel_count;
        if (init_board(&skin->boards[i], description, i)) {
            fprintf(stderr, "skin: out of memory\n");
            return -1;
        }
    }
    skin_advance(skin, stimulus); /* stimulus_open() has read the first record */
    return skin->boards ? 0 : -1;
}

/* Free the skins of all boards. */
void skin_free(struct skin *skin)
{
    for (size_t i = 0; skin->boards && i < skin->board_count; i++) {
        struct skin_board *board = &skin->boards[i];
        field_free(&board->field);
        field_load_free(&board->loads[0]);
        field_load_free(&board->loads[1]);
        patch_free(&board->patch);
        free(board->before);
        free(board->after);
        free(board->compression);
    }
    free(skin->boards);
    memset(skin, 0, sizeof *skin);
}

/* Arguments of load_board() for all boards. */
struct load_task {
    struct skin *skin;
    const struct stimulus *stimulus;
    const float *values;
};

/* Compute the load of board `item` at the next record into the slot of the later load; task of the thread pool. */
static void load_board(void *context, size_t item)
{
    const struct load_task *load_task = context;
    const struct skin *skin = load_task->skin;
    struct skin_board *board = &skin->boards[item];
    const struct field_load *last = &board->loads[skin->earlier];
    struct field_load *load = &board->loads[skin->earlier ^ 1u];
    if (load_task->stimulus->kind == STIMULUS_SCENE) {
        board_load_from_scene(board, skin->description, item, load_task->values, last, load);
    } else {
        board_load_from_forces(board, load_task->values + board->first_taxel, load);
    }
}

/* Compute the load (pressures and gaps) of all boards from the values of one stimulus record, in several
 * threads. */
static void load_boards(struct skin *skin, const struct stimulus *stimulus, const float *values)
{
    struct load_task load_task = {.skin = skin, .stimulus = stimulus, .values = values};
    thread_pool_run(skin->thread_pool, skin->board_count, load_board, &load_task);
}

/* Arguments of advance_board() for all boards. */
struct advance_task {
    struct skin *skin;
    struct field_moment moment;
};

/* Compute the fields of board `item` at the end of the step; task of the thread pool. From the third step without a
 * change on, `before` and `after` both equal the result and the board is skipped. */
static void advance_board(void *context, size_t item)
{
    const struct advance_task *advance_task = context;
    const struct skin *skin = advance_task->skin;
    const struct field_moment *moment = &advance_task->moment;
    struct skin_board *board = &skin->boards[item];
    const struct field_load *before = &board->loads[skin->earlier], *after = &board->loads[skin->earlier ^ 1u];
    const bool is_steady =
        moment->fraction == 0.0 || after->equals_previous || (before->is_unloaded && after->is_unloaded);
    board->unchanged_steps =
        is_steady && !field_has_history(&board->field, moment->time) ? board->unchanged_steps + 1u : 0u;
    if (board->unchanged_steps > 2u) {
        return; /* `before` and `after` already equal the result */
    }
    struct taxel_field *const previous = board->before;
    board->before = board->after;
    board->after = previous;
    field_advance(&board->field, before, after, moment, board->after);
}

/* Compute the fields of all boards at `time`, the end of a step. The fields at the end of the previous step become the
 * fields at the start of this step. `fraction`: position of `time` between the two loads, 0 to 1. */
static void advance_fields(struct skin *skin, double fraction, vtime time)
{
    struct advance_task advance_task = {
        .skin = skin,
        .moment =
            {
                .fraction = fraction,
                .seconds = time > skin->history_time ? (double)(time - skin->history_time) / (double)VTIME_SECOND : 0.0,
                .time = (double)time / (double)VTIME_SECOND,
                .is_step = skin->is_step,
            },
    };
    skin->history_time = vtime_max(skin->history_time, time);
    thread_pool_run(skin->thread_pool, skin->board_count, advance_board, &advance_task);
}

/* Return whether the load on the skin changes continuously until the next record of the stimulus. */
static bool load_changes(const struct stimulus *stimulus)
{
    return stimulus->until != VTIME_NEVER && !stimulus->is_step &&
           memcmp(stimulus->before, stimulus->after, stimulus->value_count * sizeof *stimulus->after) != 0;
}

/* Start the next time step of the skin, which ends at the next record or earlier. Steps before the record are needed if
 * effects depend on time, or if changing forces pass through the nonlinear layer. The step length grows while no load
 * changes. */
static void start_step(struct skin *skin, const struct stimulus *stimulus)
{
    const bool changes = load_changes(stimulus);
    const bool in_steps = skin->is_dynamic || (changes && stimulus->kind == STIMULUS_FORCE);
    const vtime end = stimulus->until;
    skin->until = in_steps ? vtime_min(end, skin->from + skin->step) : end;
    skin->next = skin->until < end ? skin->until : VTIME_NEVER;
    if (skin->until == VTIME_NEVER) {
        return;
    }
    skin->is_step = skin->until == end && stimulus->is_step;
    skin->step = changes || stimulus->is_live ? skin->step : vtime_min(2u * skin->step, LAST_STEP);
    const double interval = (double)(end - stimulus->from), elapsed = (double)(skin->until - stimulus->from);
    advance_fields(skin, skin->until == end ? 1.0 : changes ? elapsed / interval : 0.0, skin->until);
}

/* Start the interval between the record at `now` and the next record: compute the load of the next record, if it is
 * known, and the fields at the end of the first step. */
static void begin_interval(struct skin *skin, const struct stimulus *stimulus, vtime now)
{
    skin->from = now;
    skin->step = stimulus->is_live ? LIVE_STEP : FIRST_STEP;
    if (stimulus->until != VTIME_NEVER) {
        load_boards(skin, stimulus, stimulus->after);
    }
    start_step(skin, stimulus);
}

/* Start the next interval when the stimulus has reached its next record: the later load becomes the earlier one. */
void skin_advance(struct skin *skin, const struct stimulus *stimulus)
{
    if (skin->boards) {
        skin->earlier ^= 1u;
        begin_interval(skin, stimulus, stimulus->from);
    }
}

/* Start the next time step: the end of the last step becomes the start of the new step, and the fields at the end of
 * the new step are computed. */
void skin_step(struct skin *skin, const struct stimulus *stimulus)
{
    skin->from = skin->until;
    start_step(skin, stimulus);
}

/* Interpolate the fields at `now`, which lies within the present step, and make them the start of the next step. */
static void freeze_fields(struct skin *skin, vtime now)
{
    for (size_t i = 0; i < skin->board_count; i++) {
        struct skin_board *board = &skin->boards[i];
        /* after more than 2 unchanged steps, `before` and `after` are equal and need no interpolation */
        for (size_t taxel = 0; board->unchanged_steps <= 2u && taxel < board->patch.taxel_count; taxel++) {
            board->after[taxel] = skin_field(skin, i, taxel, now);
        }
    }
    skin->until = VTIME_NEVER;
}

/* Apply a record that arrived at `now`. The fields at `now` become the start of a new interval. If the record takes
 * effect at once, its load replaces the present load as a step. */
void skin_apply_live_record(struct skin *skin, const struct stimulus *stimulus, vtime now)
{
    if (!skin->boards) {
        return;
    }
    freeze_fields(skin, now);
    if (stimulus->until == VTIME_NEVER) {
        load_boards(skin, stimulus, stimulus->before);
        skin->is_step = true;
        skin->from = now;
        advance_fields(skin, 1.0, now);
        skin->earlier ^= 1u;
    }
    begin_interval(skin, stimulus, now);
}

/* Return the weight of the fields at `until` for a time between `from` and `until`: linear, or 0 while the fields
 * change only in a step at `until`. */
static double compute_fraction(const struct skin *skin, vtime time)
{
    if (skin->until == VTIME_NEVER) {
        return 1.0;
    }
    return skin->is_step || time <= skin->from ? 0.0 : (double)(time - skin->from) / (double)(skin->until - skin->from);
}

/* Return the field of a taxel at `time`: relative rise of the permittivity, gap (metres) and force (newtons),
 * interpolated between the start and the end of the present step. */
struct taxel_field skin_field(const struct skin *skin, size_t board, size_t taxel, vtime time)
{
    const struct taxel_field *before = &skin->boards[board].before[taxel];
    const struct taxel_field *after = &skin->boards[board].after[taxel];
    const double fraction = compute_fraction(skin, time);
    if (fraction == 1.0) {
        return *after;
    }
    return (struct taxel_field){
        .rise = before->rise + fraction * (after->rise - before->rise),
        .gap = before->gap + fraction * (after->gap - before->gap),
        .force = before->force + fraction * (after->force - before->force),
    };
}
