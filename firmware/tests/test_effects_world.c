/* Effects of the skin in a whole world: strength zero is bit-identical to the ideal sensor, and active effects change
 * the counts at the host. */
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "fake_world.h"
#include "skin_bench.h"

#define BOARDS 2u
#define BOARDS_MAX 12u
#define TAXELS 12u
#define RECORDS 40u

static struct fake_world fake;
static struct thread_pool *thread_pool; /* used by the following runs */
static unsigned boards = BOARDS;
static struct taxel_pose poses[TAXELS];
static struct object_description table = {
    .shape =
        {.kind = SHAPE_CONVEX,
         .bound = 0.3,
         .plane_count = 6,
         .planes = {{0, 0, 1, 0}, {0, 0, -1, 0.1}, {1, 0, 0, 0.2}, {-1, 0, 0, 0.2}, {0, 1, 0, 0.2}, {0, -1, 0, 0.2}}},
};

/* Describe a world with a table as object and these effect lines (ended by NULL). */
static void describe(const char *const *lines)
{
    fake_world_describe(&fake, boards, TAXELS);
    fake.description.noise_counts = 0.0;
    fake.description.boards[2].address = 0x21; /* the address that the renaming below leaves free */
    fake.description.boards[1].address = BENCH_ADDRESS;
    table.offset = frame_identity;
    fake.description.objects = &table;
    fake.description.object_count = 1;
    for (size_t i = 0; i < TAXELS; i++) {
        poses[i] = (struct taxel_pose){
            .position = {0.0, -TAXEL_PITCH_M * (double)i, 0.0}, .normal = {0, 0, 1}, .distal = {1, 0, 0}};
    }
    for (size_t i = 0; i < boards; i++) {
        fake.description.boards[i].taxel_poses = poses;
        fake.description.boards[i].taxel_pose_count = TAXELS;
    }
    for (; lines && *lines; lines++) {
        CHECK_EQUAL(add_effect(&fake.description, *lines), 0);
    }
}

/* Return the descriptor of a stimulus with records every 20 ms from 0.5 s on: a contact on board 0 (on all boards if
 * there are more than two) that increases and decreases; no contact before and after. */
static int stimulus_file(enum stimulus_kind kind)
{
    uint8_t header[24] = "TAXELSTM";
    const int fd = memfd_create("stimulus", 0);
    taxel_put_u32(header + 8, 1);
    taxel_put_u32(header + 12, (uint32_t)kind);
    taxel_put_u32(header + 16, boards * TAXELS);
    taxel_put_u32(header + 20, kind == STIMULUS_SCENE ? boards : 0u);
    bool written = write(fd, header, sizeof header) == (ssize_t)sizeof header;
    for (unsigned i = 0; i < RECORDS; i++) {
        const double time = 0.5 + 0.02 * i;
        const float part = (float)(i < RECORDS / 2 ? i : RECORDS - 1u - i) / (RECORDS / 2 - 1u);
        float values[STIMULUS_SCENE_VALUES(BOARDS_MAX)] = {0.0f};
        size_t count = boards * TAXELS;
        if (kind == STIMULUS_FORCE) {
            for (size_t n = 0; n<count; n += boards> BOARDS ? TAXELS : count) {
                values[n + 3] = values[n + 4] = 0.5f * part;
            }
        } else {
            /* from 1 mm above the skin to 0.2 mm into it, face down */
            const float height = 0.001f + 0.001f - 0.0012f * part;
            count = STIMULUS_SCENE_VALUES(boards);
            for (size_t pose = 0; pose <= boards; pose++) {
                values[1 + 12 * pose] = 1.0f;
                values[6 + 12 * pose] = values[11 + 12 * pose] = pose ? -1.0f : 1.0f;
                values[12 + 12 * pose] = pose == 0 ? 0.0f : pose == 1 || boards > BOARDS ? height : 1.0f;
            }
        }
        written = written && write(fd, &time, sizeof time) == (ssize_t)sizeof time &&
                  write(fd, values, count * sizeof *values) == (ssize_t)(count * sizeof *values);
    }
    CHECK(written);
    lseek(fd, 0, SEEK_SET);
    return fd;
}

/* Raw counts that the host received: of board 0 before, during and after the contact, and of the board at
 * BENCH_ADDRESS. */
struct outcome {
    uint32_t crc;
    uint16_t rest_count[TAXELS], pressed[TAXELS], after[TAXELS], other[TAXELS];
};

/* Run a world with this stimulus and these effect lines, and return the counts at rest and later, as the host receives
 * them, and the CRC of the stream. */
static struct outcome run(enum stimulus_kind kind, const char *const *lines)
{
    struct outcome outcome;
    describe(lines);
    CHECK_EQUAL(fake_world_open(&fake, stimulus_file(kind)), 0);
    world_use_thread_pool(&fake.world, thread_pool);
    CHECK(fake_world_start(&fake));
    memcpy(outcome.rest_count, fake.counts_of[0x20], sizeof outcome.rest_count);
    CHECK_EQUAL(fake_world_run(&fake, 0.385), 0);
    memcpy(outcome.pressed, fake.counts_of[0x20], sizeof outcome.pressed);
    CHECK_EQUAL(fake_world_run(&fake, 0.5), 0);
    memcpy(outcome.after, fake.counts_of[0x20], sizeof outcome.after);
    memcpy(outcome.other, fake.counts_of[BENCH_ADDRESS], sizeof outcome.other);
    outcome.crc = fake.stream_crc;
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
    return outcome;
}

static const enum stimulus_kind kinds[] = {STIMULUS_FORCE, STIMULUS_SCENE};

static void effects_of_strength_zero_leave_the_stream_bit_identical(void)
{
    static const char *const inactive[] = {
        "spread film length_m=0.002 strength=0",
        "spread pillars slope=0.1 strength=0",
        "rheology solid fraction=0 seconds=1",
        "rheology play fraction=0 width_m=1e-4 creep=0 seconds=1",
        "indent set fraction=0 threshold_m=1e-4 recovery_s=100",
        "indent bedding fraction=0 work_j_m2=10",
        "proximity image share=0 reach_m=0.004",
        "proximity wedge share=0 reach_m=0.001",
        "proximity conductor share=0 reach_m=0.004",
        "proximity dielectric share=0.2 reach_m=0.004 permittivity=1", /* as air */
        "moisture film board=0x22 tx=0 rx=3 radius_m=0.01 water=0",
        "moisture drying board=0x22 tx=0 rx=3 radius_m=0.01 water=0 seconds=10",
        "modulus taxels log_std=0",
        "modulus board board=0x22 factor=1",
    };
    for (size_t k = 0; k < 2; k++) {
        const uint32_t ideal = run(kinds[k], NULL).crc;
        for (size_t i = 0; i < sizeof inactive / sizeof inactive[0]; i++) {
            const char *const lines[] = {inactive[i], NULL};
            CHECK_EQUAL(run(kinds[k], lines).crc, ideal);
        }
    }
}

static const char *const all_effects[] = {
    "spread film length_m=0.002",
    "rheology play fraction=0.3 width_m=1e-4 creep=0.1 seconds=1",
    "indent set fraction=0.2 threshold_m=2e-5 recovery_s=100",
    "proximity image share=0.1 reach_m=0.004",
    "moisture drying board=0x22 tx=0 rx=3 radius_m=0.008 water=0.05 seconds=5",
    "modulus taxels log_std=0.2",
    NULL,
};

static void a_seed_reproduces_a_world_with_all_effects(void)
{
    for (size_t k = 0; k < 2; k++) {
        const struct outcome first = run(kinds[k], all_effects), second = run(kinds[k], all_effects);
        CHECK_EQUAL(first.crc, second.crc);
        CHECK(first.crc != run(kinds[k], NULL).crc);
    }
}

static void the_number_of_threads_does_not_change_the_stream(void)
{
    static struct thread_pool pool;
    boards = BOARDS_MAX;
    for (size_t k = 0; k < 2; k++) {
        const uint32_t single_threaded = run(kinds[k], all_effects).crc;
        for (size_t threads = 1; threads <= 4; threads *= 2) {
            CHECK_EQUAL(thread_pool_open(&pool, threads), 0);
            thread_pool = &pool;
            CHECK_EQUAL(run(kinds[k], all_effects).crc, single_threaded);
            thread_pool = NULL;
            thread_pool_close(&pool);
        }
    }
    boards = BOARDS;
}

/* Each effect acts on its own. The moist patch lies on the board at BENCH_ADDRESS. */
static void each_effect_changes_the_counts_at_the_host(void)
{
    const struct outcome ideal = run(STIMULUS_SCENE, NULL);
    CHECK(ideal.pressed[5] < ideal.rest_count[5] && ideal.after[5] == ideal.rest_count[5]);
    for (size_t i = 0; all_effects[i]; i++) {
        const char *const lines[] = {all_effects[i], NULL};
        const struct outcome affected = run(STIMULUS_SCENE, lines);
        if (strncmp(all_effects[i], "moisture", 8) == 0) {
            CHECK(affected.other[3] < ideal.other[3] && affected.other[11] == ideal.other[11]);
        } else if (strncmp(all_effects[i], "spread", 6) != 0) { /* a film does not change a uniform pressure */
            CHECK(memcmp(affected.pressed, ideal.pressed, sizeof affected.pressed) != 0);
        }
        if (strncmp(all_effects[i], "indent", 6) == 0) {
            CHECK(affected.after[5] < ideal.after[5]);
        }
    }
}

static void a_film_spreads_forces_to_the_neighbours(void)
{
    const char *const lines[] = {all_effects[0], NULL};
    const struct outcome ideal = run(STIMULUS_FORCE, NULL), affected = run(STIMULUS_FORCE, lines);
    CHECK(ideal.pressed[2] == ideal.rest_count[2] && affected.pressed[2] < affected.rest_count[2]);
    CHECK(affected.pressed[3] > ideal.pressed[3]);
}

/* A moist patch dries although no stimulus acts. */
static void drying_drifts_the_rest_counts_without_a_stimulus(void)
{
    const char *const lines[] = {"moisture drying board=0x22 tx=0 rx=3 radius_m=0.008 water=0.1 seconds=1", NULL};
    describe(lines);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    uint16_t last = fake.counts_of[BENCH_ADDRESS][3];
    for (int n = 0; n < 4; n++) {
        CHECK_EQUAL(fake_world_run(&fake, 0.5), 0);
        CHECK(fake.counts_of[BENCH_ADDRESS][3] > last);
        last = fake.counts_of[BENCH_ADDRESS][3];
    }
    fake_world_close(&fake);
}

/* Two records form a ramp. Steps in between, caused by an effect on the other board, do not change the result. */
static void an_effect_on_one_board_does_not_change_a_ramp_on_another(void)
{
    uint16_t counts[2];
    for (int on = 0; on < 2; on++) {
        const char *const lines[] = {"modulus board board=0x22 factor=2", NULL};
        uint8_t header[24] = "TAXELSTM";
        const int fd = memfd_create("stimulus", 0);
        taxel_put_u32(header + 8, 1);
        taxel_put_u32(header + 16, BOARDS * TAXELS);
        CHECK(write(fd, header, sizeof header) == (ssize_t)sizeof header);
        for (int i = 0; i < 2; i++) {
            const double time = 1.0 * i;
            float values[BOARDS * TAXELS] = {0.0f};
            values[3] = 2.0f * (float)i;
            CHECK(write(fd, &time, sizeof time) == (ssize_t)sizeof time &&
                  write(fd, values, sizeof values) == (ssize_t)sizeof values);
        }
        lseek(fd, 0, SEEK_SET);
        describe(on ? lines : NULL);
        CHECK_EQUAL(fake_world_open(&fake, fd), 0);
        CHECK(fake_world_start(&fake));
        counts[on] = fake.counts_of[0x20][3];
        fake_world_close(&fake);
    }
    CHECK_BETWEEN(counts[1] - counts[0], -1.0, 1.0); /* the modulus effect acts on the other board */
}

/* Live stimulus: a record with time -1 takes effect immediately, with and without effects. */
static void a_live_record_takes_effect_immediately(void)
{
    const char *const *const cases[] = {NULL, all_effects};
    for (size_t i = 0; i < 2; i++) {
        int ends[2];
        uint8_t header[24] = "TAXELSTM";
        float values[BOARDS * TAXELS] = {0.0f};
        const double now = -1.0;
        CHECK(pipe(ends) == 0);
        taxel_put_u32(header + 8, 1);
        taxel_put_u32(header + 16, BOARDS * TAXELS);
        CHECK(write(ends[1], header, sizeof header) == (ssize_t)sizeof header);
        describe(cases[i]);
        CHECK_EQUAL(fake_world_open(&fake, -1), 0);
        world_free(&fake.world);
        stimulus_close(&fake.stimulus);
        CHECK_EQUAL(stimulus_open(&fake.stimulus, ends[0], "test", BOARDS * TAXELS, true), 0);
        CHECK_EQUAL(world_init(&fake.world, &fake.description, &fake.stimulus, &fake.endpoint, &fake.script), 0);
        CHECK(fake_world_start(&fake));
        const uint16_t rest_count = fake.counts_of[0x20][3];
        values[3] = 1.0f;
        CHECK(write(ends[1], &now, sizeof now) == (ssize_t)sizeof now);
        CHECK(write(ends[1], values, sizeof values) == (ssize_t)sizeof values);
        CHECK_EQUAL(world_poll_inputs(&fake.world), 0);
        CHECK_EQUAL(fake_world_run(&fake, 0.1), 0);
        CHECK(fake.counts_of[0x20][3] < rest_count - 50);
        fake_world_close(&fake);
        close(ends[1]);
    }
}

int main(void)
{
    RUN(effects_of_strength_zero_leave_the_stream_bit_identical);
    RUN(a_seed_reproduces_a_world_with_all_effects);
    RUN(the_number_of_threads_does_not_change_the_stream);
    RUN(each_effect_changes_the_counts_at_the_host);
    RUN(a_film_spreads_forces_to_the_neighbours);
    RUN(drying_drifts_the_rest_counts_without_a_stimulus);
    RUN(an_effect_on_one_board_does_not_change_a_ramp_on_another);
    RUN(a_live_record_takes_effect_immediately);
    return check_summary();
}
