/* Scenes: world-file lines that define taxel poses and objects, and stimuli of poses. */
#define _GNU_SOURCE
#include <math.h>

#include "rejection.h"
#include "fake_world.h"

#define MAP_1 "0100000000000000000000000000000000000000000000000000000000000000"
#define WORLD "taxel-world 1\nboard 32 1 1 1 1 " MAP_1 " 0102030405060708 0 5\n"
#define SURFACE "surface 32 0 0 0 0 0 1 1 0 0\n"
#define WORLD_2 \
    "taxel-world 1\nboard 32 1 1 2 2 0300000000000000000000000000000000000000000000000000000000000000 " \
    "0102030405060708 0 5\n"
#define POSE "surface 32 0 0 0 0 0 1 1 0 0 0.005 0.004"
#define CUBE \
    "object cube 0 0 0 0.02\nplane 1 0 0 0.01\nplane -1 0 0 0.01\nplane 0 1 0 0.01\nplane 0 -1 0 0.01\n" \
    "plane 0 0 1 0.01\nplane 0 0 -1 0.01\n"

static struct world_description world;
static struct rejection rejection;
static struct fake_world fake;

static void a_valid_scene_is_read(void)
{
    unsigned lines;
    CHECK_EQUAL(rejection_read(
                    &rejection, &world,
                    WORLD "layer 0.0012\n" SURFACE CUBE "object can 0 0 0.05 0.06\ncylinder 0.03 0.1\n"
                          "bracket_offset 0x20 0.001 0 0 0 0 1.5707963267948966\nobject_offset can 0 0 0.002 0 0 0\n",
                    &lines),
                0);
    CHECK_EQUAL(lines, 0);
    CHECK(world.layer_thickness == 0.0012);
    CHECK_EQUAL(world.boards[0].taxel_pose_count, 1);
    CHECK(world.boards[0].taxel_poses[0].distal[0] == 1.0);
    CHECK_EQUAL(world.object_count, 2);
    CHECK_EQUAL(world.objects[0].shape.plane_count, 6);
    CHECK(world.objects[1].shape.kind == SHAPE_CYLINDER && world.objects[1].shape.height == 0.1);
    CHECK(world.boards[0].bracket_offset.row[0][3] == 0.001 &&
          fabs(world.boards[0].bracket_offset.row[1][0] - 1.0) < 1e-12);
    CHECK(world.objects[1].offset.row[2][3] == 0.002 && world.objects[0].offset.row[2][3] == 0.0);
    world_file_free(&world);
}

static void places_on_the_unrolled_sheet_are_read(void)
{
    unsigned lines;
    CHECK_EQUAL(rejection_read(&rejection, &world, WORLD_2 POSE " 3 7\n" POSE " 3 15\n", &lines), 0);
    CHECK_EQUAL(lines, 0);
    CHECK_EQUAL(world.boards[0].taxel_pose_count, 2);
    const struct taxel_pose *poses = world.boards[0].taxel_poses;
    CHECK(poses[0].has_place && poses[0].row == 3 && poses[0].column == 7);
    CHECK(poses[1].has_place && poses[1].row == 3 && poses[1].column == 15);
    CHECK(poses[0].size[0] == 0.005 && poses[0].size[1] == 0.004);
    world_file_free(&world);
}

static const char *const invalid_places[] = {
    WORLD_2 POSE " 3 7\n" POSE " 3 7\n",                          /* two taxels at the same place */
    WORLD_2 POSE " 3 7\n" POSE "\n",                              /* a place for the first taxel only */
    WORLD_2 POSE "\n" POSE " 3 7\n",                              /* a place for the second taxel only */
    WORLD_2 POSE " 3 7\nsurface 32 0 0 0 0 0 1 1 0 0\n",          /* neither sides nor a place */
    WORLD_2 POSE " 3\n" POSE " 4\n",                              /* a row without a column */
    WORLD_2 POSE " -1 7\n" POSE " 0 7\n",                         /* outside the sheet */
    WORLD_2 POSE " 3 16\n" POSE " 3 7\n",                         /* outside the sheet */
    WORLD_2 POSE " 3 x\n" POSE " 3 7\n",                          /* no number */
    WORLD_2 "surface 32 0 0 0 0 0 1 1 0 0 0.005\n" POSE "\n",     /* one side of a square */
    WORLD_2 "surface 32 0 0 0 0 0 1 1 0 0 0.005 0\n" POSE "\n",   /* a side of length 0 */
    WORLD_2 "surface 32 0 0 0 0 0 1 1 0 0 0.005 0.2\n" POSE "\n", /* a side above 0.1 m */
};

static void invalid_places_are_rejected_with_one_line(void)
{
    rejection_check_all(invalid_places, sizeof invalid_places / sizeof invalid_places[0]);
}

static const char *const invalid_scenes[] = {
    WORLD "layer\n",
    WORLD "layer 0\n",
    WORLD "layer 0.1\n",
    "taxel-world 1\n" SURFACE,
    WORLD "surface 33 0 0 0 0 0 1 1 0 0\n",
    WORLD "surface 32 0 0 0 0 0 1 1 0\n",
    WORLD "surface 32 0 0 0 0 0 2 1 0 0\n",
    WORLD "surface 32 0 0 0 0 0 0.9 1 0 0\n",
    WORLD "surface 32 0 0 0 0 0 1 0 0 0\n",
    WORLD "surface 32 0 0 nan 0 0 1 1 0 0\n",
    WORLD "surface 32 0 0 1e9 0 0 1 1 0 0\n",
    WORLD SURFACE SURFACE,
    "taxel-world 1\nboard 32 1 1 2 2 03"
    "00000000000000000000000000000000000000000000000000000000000000"
    " 0102030405060708 0 5\n" SURFACE,
    WORLD "object\n",
    WORLD "object cube\n",
    WORLD "object cube 0 0 0 0\n",
    WORLD "object a_name_that_is_much_too_long_for_an_object 0 0 0 0.1\ncylinder 0.03 0.1\n",
    WORLD "object cube 0 0 0 0.1\n",
    WORLD "object cube 0 0 0 0.1\nplane 1 0 0 0.01\nplane -1 0 0 0.01\nplane 0 1 0 0.01\n",
    WORLD "plane 1 0 0 0.01\n",
    WORLD "cylinder 0.03 0.1\n",
    WORLD "object cube 0 0 0 0.1\nplane 1 0 0\n",
    WORLD "object cube 0 0 0 0.1\nplane 1 1 0 0.01\n",
    WORLD "object cube 0 0 0 0.1\nplane 1 0 0 x\n",
    WORLD "object can 0 0 0 0.1\ncylinder 0.03\n",
    WORLD "object can 0 0 0 0.1\ncylinder -0.03 0.1\n",
    WORLD "object can 0 0 0 0.1\ncylinder 0.03 0.1\nplane 1 0 0 0.01\n",
    WORLD CUBE "cylinder 0.03 0.1\n",
    WORLD "bracket_offset 33 0 0 0 0 0 0\n",
    WORLD "bracket_offset 32 0 0 0 0 0\n",
    WORLD "bracket_offset 32 0 0 0 0 0 9\n",
    WORLD "bracket_offset 32 2 0 0 0 0 0\n",
    WORLD "object_offset cube 0 0 0 0 0 0\n" CUBE,
    WORLD CUBE "object_offset\n",
    WORLD CUBE "object_offset cub 0 0 0 0 0 0\n",
    WORLD CUBE "object_offset cube 0 0 0 0 0\n",
};

static void invalid_scenes_are_rejected_with_one_line(void)
{
    rejection_check_all(invalid_scenes, sizeof invalid_scenes / sizeof invalid_scenes[0]);
}

static void too_many_objects_or_planes_are_rejected(void)
{
    static char text[40000] = WORLD;
    for (int i = 0; i <= WORLD_OBJECTS_MAX; i++) {
        strcat(text, "object can 0 0 0 0.1\ncylinder 0.03 0.1\n");
    }
    const char *const objects = text;
    rejection_check_all(&objects, 1);
    static char planes[40000] = WORLD "object ball 0 0 0 0.1\n";
    for (int i = 0; i <= SHAPE_PLANES_MAX; i++) {
        strcat(planes, "plane 1 0 0 0.01\n");
    }
    const char *const many_planes = planes;
    rejection_check_all(&many_planes, 1);
}

/* Return the file descriptor of a scene stimulus of `boards` boards and `taxels` taxels with one record: the cube at x
 * (metres). */
static int scene_file(uint32_t boards, uint32_t taxels, float x)
{
    uint8_t header[24] = "TAXELSTM";
    const double time = 0.0;
    float values[STIMULUS_SCENE_VALUES(4)] = {0.0f};
    const int fd = memfd_create("scene", 0);
    taxel_put_u32(header + 8, 1);
    taxel_put_u32(header + 12, STIMULUS_SCENE);
    taxel_put_u32(header + 16, taxels);
    taxel_put_u32(header + 20, boards);
    for (size_t pose = 0; pose <= boards; pose++) {
        values[1 + 12 * pose] = values[6 + 12 * pose] = values[11 + 12 * pose] = 1.0f;
    }
    values[4] = x;
    const size_t size = STIMULUS_SCENE_VALUES(boards) * sizeof *values;
    CHECK(write(fd, header, sizeof header) == (ssize_t)sizeof header &&
          write(fd, &time, sizeof time) == (ssize_t)sizeof time && write(fd, values, size) == (ssize_t)size);
    lseek(fd, 0, SEEK_SET);
    return fd;
}

static struct taxel_pose pose_of_taxel = {.normal = {1.0, 0.0, 0.0}, .distal = {0.0, 0.0, 1.0}};
static struct object_description cube = {
    .shape = {.kind = SHAPE_CONVEX,
              .bound = 0.02,
              .plane_count = 6,
              .planes = {{1, 0, 0, 0.01},
                         {-1, 0, 0, 0.01},
                         {0, 1, 0, 0.01},
                         {0, -1, 0, 0.01},
                         {0, 0, 1, 0.01},
                         {0, 0, -1, 0.01}}},
};

/* Describe a world with one taxel and a cube; `has_poses`: the world states the pose of the taxel. */
static void describe(bool has_poses)
{
    fake_world_describe(&fake, 1, 1);
    fake.description.noise_counts = 0.0;
    cube.offset = frame_identity;
    fake.description.objects = &cube;
    fake.description.object_count = 1;
    fake.description.boards[0].taxel_pose_count = has_poses;
    fake.description.boards[0].taxel_poses = has_poses ? &pose_of_taxel : NULL;
}

static void a_scene_that_does_not_match_the_world_is_rejected_with_one_line(void)
{
    static const struct {
        bool has_poses;
        uint32_t boards;
        int result;
    } cases[] = {{true, 1, 0}, {true, 2, -1}, {false, 1, -1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        describe(cases[i].has_poses);
        rejection_catch(&rejection);
        const int result = fake_world_open(&fake, scene_file(cases[i].boards, 1, 0.05f));
        CHECK_EQUAL(rejection_lines(&rejection), result ? 1 : 0);
        CHECK_EQUAL(result, cases[i].result);
        fake_world_close(&fake);
    }
    describe(true);
    rejection_catch(&rejection);
    CHECK_EQUAL(fake_world_open(&fake, scene_file(0, 1, 0.05f)), -1);
    CHECK_EQUAL(rejection_lines(&rejection), 1);
    fake_world_close(&fake);
}

/* Return the raw count of the taxel. `x`: stated position of the cube (metres). `offset`: error of its pose along x
 * (metres). */
static unsigned count_with_cube_at(float x, double offset)
{
    describe(true);
    cube.offset.row[0][3] = offset;
    CHECK_EQUAL(fake_world_open(&fake, scene_file(1, 1, x)), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.1), 0);
    const unsigned count = fake.counts_of[0x20][0];
    fake_world_close(&fake);
    return count;
}

static void counts_fall_under_contact_and_follow_the_actual_object_pose(void)
{
    const unsigned rest_count = count_with_cube_at(0.05f, 0.0), above_skin = count_with_cube_at(0.0111f, 0.0);
    const unsigned pressed = count_with_cube_at(0.0109f, 0.0), deeper = count_with_cube_at(0.0108f, 0.0);
    /* the skin surface is 1 mm above the electrode, and the cube's face 10 mm in front of its centre */
    CHECK_EQUAL(above_skin, rest_count);
    CHECK(pressed < rest_count && deeper < pressed);
    CHECK_BETWEEN((double)count_with_cube_at(0.0128f, -0.002) - deeper, -1.0, 1.0);
}

int main(void)
{
    RUN(a_valid_scene_is_read);
    RUN(places_on_the_unrolled_sheet_are_read);
    RUN(invalid_places_are_rejected_with_one_line);
    RUN(invalid_scenes_are_rejected_with_one_line);
    RUN(too_many_objects_or_planes_are_rejected);
    RUN(a_scene_that_does_not_match_the_world_is_rejected_with_one_line);
    RUN(counts_fall_under_contact_and_follow_the_actual_object_pose);
    return check_summary();
}
