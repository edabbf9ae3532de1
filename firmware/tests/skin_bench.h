/* Test bench for the fields of one board, with effects given as world-file lines. */
#ifndef TAXEL_TESTS_SKIN_BENCH_H
#define TAXEL_TESTS_SKIN_BENCH_H

#include "check.h"
#include "emulator/effects/effect_line.h"
#include "emulator/physics/layer.h"
#include "emulator/geometry/contact.h"
#include "emulator/skin/field.h"

#define BENCH_LINES 8
#define BENCH_TAXELS (BENCH_LINES * BENCH_LINES)
#define BENCH_CELLS (BENCH_TAXELS * CELLS_PER_TAXEL)
#define BENCH_ADDRESS 0x22

/* Skin of one board with its effects, the loads before and after the current step, and the resulting fields. */
struct skin_bench {
    struct world_description world;
    struct patch patch;
    struct field field;
    struct field_load before, after;
    double compression[BENCH_CELLS];
    struct taxel_field fields[BENCH_TAXELS];
    double time;
};

/* Read an effect line without the word `effect`. Returns 0, or -1 if it is rejected. */
static inline int add_effect(struct world_description *world, const char *line)
{
    char text[256];
    struct world_line words = {.path = "test"};
    snprintf(text, sizeof text, "effect %s", line);
    world_line_split(&words, text);
    return effects_read_line(&world->effects, &words, world->boards, world->board_count);
}

/* Open an 8 x 8 board without the taxel at crossing `hole` (-1: all taxels). */
static inline void bench_open(struct skin_bench *bench, const char *line, int hole)
{
    memset(bench, 0, sizeof *bench);
    bench->world.seed = 3;
    bench->world.layer_thickness = 0.001;
    bench->world.board_count = 1;
    struct board_description *board = &bench->world.boards[0];
    board->address = BENCH_ADDRESS;
    board->rows = board->columns = BENCH_LINES;
    memset(board->crossing_map, 0xFF, BENCH_TAXELS / 8);
    board->taxel_count = BENCH_TAXELS;
    if (hole >= 0) {
        board->crossing_map[hole >> 3] &= (uint8_t)~(1u << (hole & 7));
        board->taxel_count--;
    }
    layer_init();
    CHECK(!line || add_effect(&bench->world, line) == 0);
    CHECK(patch_init(&bench->patch, BENCH_LINES, BENCH_LINES, board->crossing_map, board->taxel_count, NULL) == 0);
    CHECK(field_init(&bench->field, &bench->world, 0, &bench->patch) == 0);
    CHECK(field_load_init(&bench->before, &bench->patch) == 0 && field_load_init(&bench->after, &bench->patch) == 0);
}

static inline void bench_close(struct skin_bench *bench)
{
    field_load_free(&bench->before);
    field_load_free(&bench->after);
    field_free(&bench->field);
    patch_free(&bench->patch);
}

/* Advance the fields by `seconds` to the load `after`, which then becomes the load before the next step. */
static inline void bench_advance(struct skin_bench *bench, double seconds, bool is_step)
{
    bench->time += seconds;
    const struct field_moment moment = {.fraction = 1.0, .seconds = seconds, .time = bench->time, .is_step = is_step};
    field_advance(&bench->field, &bench->before, &bench->after, &moment, bench->fields);
    const struct field_load previous = bench->before;
    bench->before = bench->after;
    bench->after = previous;
    field_load_clear(&bench->after, &bench->patch);
}

/* Advance by `seconds` while the force (newtons) on one taxel changes to `force`: linearly, or at the end if
 * `is_step`. */
static inline void bench_apply_force(struct skin_bench *bench, size_t taxel, double force, double seconds, bool is_step)
{
    float forces[BENCH_TAXELS] = {0.0f};
    forces[taxel] = (float)force;
    field_load_forces(&bench->field, forces, bench->compression, &bench->after);
    bench_advance(bench, seconds, is_step);
}

#endif
