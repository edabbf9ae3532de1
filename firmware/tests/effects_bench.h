/* Test bench for the electronics of one board: effect lines and rises as inputs, raw counts of a whole scan as output.
 */
#ifndef TAXEL_TESTS_EFFECTS_BENCH_H
#define TAXEL_TESTS_EFFECTS_BENCH_H

#include <stdlib.h>

#include "check.h"
#include "emulator/electronics.h"
#include "emulator/effects/effect_line.h"

/* Read an effect line of a world file, without the word `effect`. Returns 0 or -1. */
static inline int read_effect(struct world_description *world, const char *text)
{
    char line[256];
    struct world_line words = {.path = "test", .number = 1};
    snprintf(line, sizeof line, "effect %s", text);
    world_line_split(&words, line);
    return effects_read_line(&world->effects, &words, world->boards, world->board_count);
}

/* Electronics of one board of a described world, with inputs and results of a scan. */
struct bench {
    struct world_description world;
    struct front_end front_end;
    struct normal_source normals;
    struct electronics *electronics; /* NULL: no effect is active */
    struct droop_loads loads;
    double rise[TAXEL_TAXELS_MAX];
    uint16_t raw[TAXEL_TAXELS_MAX];
    double max_count, rest_count[TAXEL_TAXELS_MAX]; /* counts */
};

/* Return the rise of a taxel, which is constant over time; callback of the electronics. */
static inline double bench_get_rise(const void *source, size_t taxel, vtime time)
{
    (void)time;
    return ((const struct bench *)source)->rise[taxel];
}

/* Copy the rises of all taxels; callback of the electronics. */
static inline void bench_get_all_rises(const void *source, vtime time, double *rise)
{
    (void)time;
    memcpy(rise, ((const struct bench *)source)->rise, sizeof((const struct bench *)source)->rise);
}

static inline void bench_close(struct bench *bench)
{
    free(bench->electronics);
    bench->electronics = NULL;
}

/* Describe `boards` boards of equal size at 0x20 and up, with a taxel at every crossing. */
static inline void bench_describe(struct bench *bench, size_t boards, uint8_t rows, uint8_t columns)
{
    bench_close(bench);
    memset(bench, 0, sizeof *bench);
    bench->world.seed = 5;
    bench->world.scan = (struct taxel_scan_settings){160, 40, 1, 16, 96};
    bench->world.board_count = boards;
    for (size_t i = 0; i < boards; i++) {
        struct board_description *board = &bench->world.boards[i];
        board->address = (uint8_t)(0x20u + i);
        board->rows = rows;
        board->columns = columns;
        board->taxel_count = (uint16_t)(rows * columns);
        for (unsigned n = 0; n < board->taxel_count; n++) {
            board->crossing_map[n >> 3] |= (uint8_t)(1u << (n & 7u));
        }
    }
}

/* Add an effect line, which must be valid, to the described world. */
static inline void bench_effect(struct bench *bench, const char *text)
{
    if (!CHECK(read_effect(&bench->world, text) == 0)) {
        printf("  effect %s\n", text);
    }
}

/* Create the electronics of board number `board` of the described world, with all its effects. */
static inline void bench_open(struct bench *bench, size_t board)
{
    const struct board_description *description = &bench->world.boards[board];
    bench_close(bench);
    normal_source_init(&bench->normals, bench->world.seed, description->address);
    front_end_init(&bench->front_end, description->taxel_count, bench->world.noise_counts, &bench->normals);
    gain_apply(&bench->world.effects.gain, board, bench->world.seed, description->address, &bench->front_end);
    front_end_configure(&bench->front_end, &bench->world.scan, 1.0);
    if (electronics_are_needed(&bench->world, board)) {
        bench->electronics = electronics_open(&bench->world, board, &bench->front_end);
        CHECK(bench->electronics != NULL);
    }
    bench->max_count = bench->front_end.max_count;
    for (size_t i = 0; i < description->taxel_count; i++) {
        bench->rest_count[i] = bench->front_end.taxels[i].rest_hardware_count;
    }
}

/* Scan the whole board once, with conversions 140 us apart; writes raw[taxels]. */
static inline void bench_scan(struct bench *bench, size_t board, double seconds)
{
    const struct board_description *description = &bench->world.boards[board];
    vtime time = (vtime)(seconds * (double)VTIME_SECOND);
    for (int n = 0; n < description->taxel_count; n++, time += 140u * VTIME_US) {
        const struct electronics_conversion conversion = {
            .tx = n / description->columns,
            .rx = n % description->columns,
            .is_first_of_scan = n == 0,
            .time = time,
            .loads = &bench->loads,
            .get_rise = bench_get_rise,
            .get_all_rises = bench_get_all_rises,
            .rise_context = bench,
        };
        bench->raw[n] = bench->electronics ? electronics_convert(bench->electronics, &conversion)
                                           : front_end_convert(&bench->front_end, (uint16_t)n, bench->rise[n]);
    }
}

#endif
