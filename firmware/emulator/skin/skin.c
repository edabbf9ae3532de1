#include "emulator/skin/skin.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/skin/press.h"

#define FIRST_STEP (10u * VTIME_MS)
#define LIVE_STEP (20u * VTIME_MS) /* nobody knows when the next record comes */
#define LAST_STEP VTIME_SECOND

static const struct field_moment begin = {0.0, 0.0, 0.0, false};

static int init_board(struct skin_board *board, const struct world_description *description, size_t index)
{
    const struct board_description *sheet = &description->boards[index];
    if (patch_init(&board->patch, sheet->rows, sheet->columns, sheet->crossing_map, sheet->taxel_count, sheet->places) ||
        patch_add_margins(&board->patch, sheet->margin_count, sheet->margins) ||
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
    field_advance(&board->field, &board->loads[0], &board->loads[1], &begin, board->after);
    memcpy(board->before, board->after, taxels * sizeof *board->before);
    return 0;
}

static bool is_placed(const struct world_description *description)
{
    for (size_t i = 0; i < description->board_count; i++) {
        if (!description->boards[i].placed) {
            return false;
        }
    }
    return true;
}

static int check_scene(const struct world_description *description, const struct stimulus *stimulus)
{
    if (!is_placed(description)) {
        fprintf(stderr, "stimulus %s: gives poses, but the world does not place every taxel (surface)\n", stimulus->name);
        return -1;
    }
    if (stimulus->values != STIMULUS_SCENE_VALUES(description->board_count)) {
        fprintf(stderr, "stimulus %s: gives poses of another number of boards than the world's %zu\n", stimulus->name,
                description->board_count);
        return -1;
    }
    return 0;
}

int skin_init(struct skin *skin, const struct world_description *description, const struct stimulus *stimulus)
{
    memset(skin, 0, sizeof *skin);
    skin->description = description;
    skin->board_count = description->board_count;
    skin->next = VTIME_NEVER;
    skin->until = VTIME_NEVER;
    skin->takes_time = field_effects_take_time(&description->effects);
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
    skin_advance(skin, stimulus); /* opening the stimulus has read its first record */
    return skin->boards ? 0 : -1;
}

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

struct press {
    struct skin *skin;
    const struct stimulus *stimulus;
    const float *values;
};

static void press_board(void *context, size_t item)
{
    const struct press *press = context;
    const struct skin *skin = press->skin;
    struct skin_board *board = &skin->boards[item];
    const struct field_load *last = &board->loads[skin->earlier];
    struct field_load *load = &board->loads[skin->earlier ^ 1u];
    if (press->stimulus->kind == STIMULUS_SCENE) {
        press_scene(board, skin->description, item, press->values, last, load);
    } else {
        press_forces(board, press->values + board->first_taxel, load);
    }
}

static void press_boards(struct skin *skin, const struct stimulus *stimulus, const float *values)
{
    struct press press = {.skin = skin, .stimulus = stimulus, .values = values};
    thread_pool_run(skin->thread_pool, skin->board_count, press_board, &press);
}

struct advance {
    struct skin *skin;
    struct field_moment moment;
};

static void advance_board(void *context, size_t item)
{
    const struct advance *advance = context;
    const struct skin *skin = advance->skin;
    const struct field_moment *moment = &advance->moment;
    struct skin_board *board = &skin->boards[item];
    const struct field_load *before = &board->loads[skin->earlier], *after = &board->loads[skin->earlier ^ 1u];
    const bool steady = moment->fraction == 0.0 || after->repeats || (before->idle && after->idle);
    board->quiet = steady && !field_is_awake(&board->field, moment->time) ? board->quiet + 1u : 0u;
    if (board->quiet > 2u) {
        return; /* `before` and `after` are what this would make them */
    }
    struct taxel_field *const spare = board->before;
    board->before = board->after;
    board->after = spare;
    field_advance(&board->field, before, after, moment, board->after);
}

/* Fields at `until`, those that were there before to be those at `from`. */
static void advance_fields(struct skin *skin, double fraction, vtime time)
{
    struct advance advance = {
        .skin = skin,
        .moment =
            {
                .fraction = fraction,
                .seconds = time > skin->remembered ? (double)(time - skin->remembered) / (double)VTIME_SECOND : 0.0,
                .time = (double)time / (double)VTIME_SECOND,
                .jump = skin->jump,
            },
    };
    skin->remembered = vtime_max(skin->remembered, time);
    thread_pool_run(skin->thread_pool, skin->board_count, advance_board, &advance);
}

static bool load_changes(const struct stimulus *stimulus)
{
    return stimulus->until != VTIME_NEVER && !stimulus->step &&
           memcmp(stimulus->before, stimulus->after, stimulus->values * sizeof *stimulus->after) != 0;
}

/* The next fields: at the next record, or at a step before it. Steps grow while nothing but time acts. */
static void go_on(struct skin *skin, const struct stimulus *stimulus)
{
    const bool changes = load_changes(stimulus);
    const bool in_steps = skin->takes_time || (changes && stimulus->kind == STIMULUS_FORCE);
    const vtime end = stimulus->until;
    skin->until = in_steps ? vtime_min(end, skin->from + skin->step) : end;
    skin->next = skin->until < end ? skin->until : VTIME_NEVER;
    if (skin->until == VTIME_NEVER) {
        return;
    }
    skin->jump = skin->until == end && stimulus->step;
    skin->step = changes || stimulus->live ? skin->step : vtime_min(2u * skin->step, LAST_STEP);
    const double whole = (double)(end - stimulus->from), part = (double)(skin->until - stimulus->from);
    advance_fields(skin, skin->until == end ? 1.0 : changes ? part / whole : 0.0, skin->until);
}

static void begin_interval(struct skin *skin, const struct stimulus *stimulus, vtime now)
{
    skin->from = now;
    skin->step = stimulus->live ? LIVE_STEP : FIRST_STEP;
    if (stimulus->until != VTIME_NEVER) {
        press_boards(skin, stimulus, stimulus->after);
    }
    go_on(skin, stimulus);
}

void skin_advance(struct skin *skin, const struct stimulus *stimulus)
{
    if (skin->boards) {
        skin->earlier ^= 1u;
        begin_interval(skin, stimulus, stimulus->from);
    }
}

void skin_step(struct skin *skin, const struct stimulus *stimulus)
{
    skin->from = skin->until;
    go_on(skin, stimulus);
}

/* What holds at a time inside [from, until] becomes what the next fields start from. */
static void settle(struct skin *skin, vtime now)
{
    for (size_t i = 0; i < skin->board_count; i++) {
        struct skin_board *board = &skin->boards[i];
        for (size_t taxel = 0; board->quiet <= 2u && taxel < board->patch.taxel_count; taxel++) {
            board->after[taxel] = skin_field(skin, i, taxel, now);
        }
    }
    skin->until = VTIME_NEVER;
}

void skin_take_live(struct skin *skin, const struct stimulus *stimulus, vtime now)
{
    if (!skin->boards) {
        return;
    }
    settle(skin, now);
    if (stimulus->until == VTIME_NEVER) {
        press_boards(skin, stimulus, stimulus->before);
        skin->jump = true;
        skin->from = now;
        advance_fields(skin, 1.0, now);
        skin->earlier ^= 1u;
    }
    begin_interval(skin, stimulus, now);
}

static double fraction_at(const struct skin *skin, vtime time)
{
    if (skin->until == VTIME_NEVER) {
        return 1.0;
    }
    return skin->jump || time <= skin->from ? 0.0 : (double)(time - skin->from) / (double)(skin->until - skin->from);
}

struct taxel_field skin_field(const struct skin *skin, size_t board, size_t taxel, vtime time)
{
    const struct taxel_field *before = &skin->boards[board].before[taxel];
    const struct taxel_field *after = &skin->boards[board].after[taxel];
    const double fraction = fraction_at(skin, time);
    if (fraction == 1.0) {
        return *after;
    }
    return (struct taxel_field){
        .rise = before->rise + fraction * (after->rise - before->rise),
        .gap = before->gap + fraction * (after->gap - before->gap),
        .force = before->force + fraction * (after->force - before->force),
    };
}
