#include "emulator/world_file/world_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/geometry/vector.h"

#define COORDINATE_MAX_M 100.0
#define OFFSET_MAX_M 1.0
#define OFFSET_MAX_RAD 3.2
#define COMPONENT_MAX 1.1 /* of a unit vector; normalise() checks the length */
#define UNIT_TOLERANCE 1e-3
/* Cosine of the smallest angle, 8 degrees, between the normal and the distal direction, which defines the sides. */
#define COSINE_MAX 0.99
#define SIDES_WORD 11 /* index of the first optional word of a surface or margin line */
#define PLACE_WORD 13
#define SIDE_MAX_M 0.1

/* Scale a direction vector to length 1, which removes the rounding of its decimal digits in the file. Returns 0, or -1
 * after an error line on stderr if the length deviates from 1 by more than 0.001. */
static int normalise(const struct world_reader *reader, double vector[3])
{
    const double length = sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    if (fabs(length - 1.0) > UNIT_TOLERANCE) {
        return world_line_report_error(&reader->line, "expected a direction vector of length 1");
    }
    for (int k = 0; k < 3; k++) {
        vector[k] /= length;
    }
    return 0;
}

/* Read ADDRESS X Y Z NX NY NZ DX DY DZ [A B]: position (metres), outward normal, distal direction and optionally the
 * sides of the square (metres) of a taxel or margin in the frame of its bracket. Returns 0, or -1 after an error line
 * on stderr. */
static int read_taxel_pose(const struct world_reader *reader, struct taxel_pose *pose)
{
    const struct world_line *line = &reader->line;
    *pose = (struct taxel_pose){.has_place = false};
    if (line->count > SIDES_WORD && world_line_read_numbers(line, SIDES_WORD, 2, 1e-5, SIDE_MAX_M, pose->size)) {
        return -1;
    }
    const bool is_valid = !world_line_read_numbers(line, 2, 3, -COORDINATE_MAX_M, COORDINATE_MAX_M, pose->position) &&
                          !world_line_read_numbers(line, 5, 3, -COMPONENT_MAX, COMPONENT_MAX, pose->normal) &&
                          !world_line_read_numbers(line, 8, 3, -COMPONENT_MAX, COMPONENT_MAX, pose->distal) &&
                          !normalise(reader, pose->normal) && !normalise(reader, pose->distal);
    if (!is_valid) {
        return -1;
    }
    if (fabs(dot(pose->normal, pose->distal)) > COSINE_MAX) {
        return world_line_report_error(line, "expected a distal direction that is not parallel to the normal");
    }
    return 0;
}

/* Read a line of a world file: margin ADDRESS X Y Z NX NY NZ DX DY DZ [A B], a rectangle of sheet that no taxel
 * measures. Returns 0, or -1 after an error line on stderr. */
static int read_margin(const struct world_reader *reader)
{
    const int index = world_reader_find_board(reader, 1);
    struct taxel_pose pose;
    if (index < 0 || read_taxel_pose(reader, &pose)) {
        return -1;
    }
    struct board_description *board = &reader->world->boards[index];
    if (board->margin_count == WORLD_MARGINS_MAX) {
        return world_line_report_error(&reader->line, "more margin lines than the maximum of 512 for a board");
    }
    struct taxel_pose *margins = realloc(board->margin_poses, (board->margin_count + 1) * sizeof *margins);
    if (!margins) {
        return world_line_report_error(&reader->line, "out of memory");
    }
    board->margin_poses = margins;
    board->margin_poses[board->margin_count++] = pose;
    return 0;
}

/* Read the optional place ROW COLUMN of a taxel on the unrolled sheet of its board. All taxels of a board state a
 * place, or none does. Returns 0, or -1 after an error line on stderr. */
static int read_place(const struct world_reader *reader, const struct board_description *board, struct taxel_pose *pose)
{
    const struct world_line *line = &reader->line;
    long row, column;
    pose->has_place = line->count > PLACE_WORD;
    if (board->taxel_pose_count && board->taxel_poses[0].has_place != pose->has_place) {
        return world_line_report_error(line, "expected a place (ROW COLUMN) for all taxels of a board, or for none");
    }
    if (!pose->has_place) {
        return 0;
    }
    if (world_line_read_integer(line, PLACE_WORD, 0, TAXEL_LINES_MAX - 1, &row) ||
        world_line_read_integer(line, PLACE_WORD + 1, 0, TAXEL_LINES_MAX - 1, &column)) {
        return -1;
    }
    pose->row = (int)row;
    pose->column = (int)column;
    for (size_t i = 0; i < board->taxel_pose_count; i++) {
        if (board->taxel_poses[i].row == pose->row && board->taxel_poses[i].column == pose->column) {
            return world_line_report_error(line, "expected a place that no other taxel of the board has");
        }
    }
    return 0;
}

/* Read a line of a world file: surface ADDRESS X Y Z NX NY NZ DX DY DZ [A B [ROW COLUMN]], the pose of the next taxel
 * of the board. Returns 0, or -1 after an error line on stderr. */
static int read_surface(const struct world_reader *reader)
{
    const int index = world_reader_find_board(reader, 1);
    if (index < 0) {
        return -1;
    }
    struct board_description *board = &reader->world->boards[index];
    struct taxel_pose pose;
    if (board->taxel_pose_count == board->taxel_count) {
        return world_line_report_error(&reader->line, "more surface lines than the board has taxels");
    }
    if (!board->taxel_poses) {
        board->taxel_poses = calloc(board->taxel_count, sizeof *board->taxel_poses);
        if (!board->taxel_poses) {
            return world_line_report_error(&reader->line, "out of memory");
        }
    }
    if (read_taxel_pose(reader, &pose) || read_place(reader, board, &pose)) {
        return -1;
    }
    board->taxel_poses[board->taxel_pose_count++] = pose;
    return 0;
}

/* Read a line of a world file: object NAME X Y Z RADIUS, a new object and its bounding sphere (metres). Returns 0, or
 * -1 after an error line on stderr. */
static int read_object(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    double radius;
    if (world->object_count == WORLD_OBJECTS_MAX) {
        return world_line_report_error(&reader->line, "more objects than the maximum of 16");
    }
    if (reader->line.count < 2 || strlen(reader->line.words[1]) >= SHAPE_NAME_MAX) {
        return world_line_report_error(&reader->line, "expected an object name of 1 to 39 characters");
    }
    struct object_description *objects = realloc(world->objects, (world->object_count + 1) * sizeof *objects);
    if (!objects) {
        return world_line_report_error(&reader->line, "out of memory");
    }
    world->objects = objects;
    struct object_description *object = &objects[world->object_count];
    memset(object, 0, sizeof *object);
    object->offset = frame_identity;
    if (world_line_read_numbers(&reader->line, 2, 3, -COORDINATE_MAX_M, COORDINATE_MAX_M, object->shape.centre) ||
        world_line_read_number(&reader->line, 5, 1e-4, COORDINATE_MAX_M, &radius)) {
        return -1;
    }
    object->shape.bound = radius;
    memcpy(object->shape.name, reader->line.words[1], strlen(reader->line.words[1]) + 1);
    world->object_count++;
    return 0;
}

/* Return the shape of the object that the file described last, to which plane and cylinder lines belong; NULL after an
 * error line on stderr if there is no object. */
static struct shape *get_latest_shape(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    if (!world->object_count) {
        (void)world_line_report_error(&reader->line, "expected an object line before its shape");
        return NULL;
    }
    return &world->objects[world->object_count - 1].shape;
}

/* Read a line of a world file: plane NX NY NZ OFFSET. The points p of the latest object fulfil normal . p <= offset
 * (metres). Returns 0, or -1 after an error line on stderr. */
static int read_plane(const struct world_reader *reader)
{
    struct shape *shape = get_latest_shape(reader);
    double plane[4];
    if (!shape) {
        return -1;
    }
    if (shape->plane_count == SHAPE_PLANES_MAX || shape->kind == SHAPE_CYLINDER) {
        return world_line_report_error(&reader->line, "more planes than the maximum of 512, or a plane of a cylinder");
    }
    if (world_line_read_numbers(&reader->line, 1, 3, -COMPONENT_MAX, COMPONENT_MAX, plane) ||
        world_line_read_number(&reader->line, 4, -COORDINATE_MAX_M, COORDINATE_MAX_M, &plane[3]) ||
        normalise(reader, plane)) {
        return -1;
    }
    memcpy(shape->planes[shape->plane_count++], plane, sizeof plane);
    return 0;
}

/* Read a line of a world file: cylinder RADIUS HEIGHT (metres). The latest object is a cylinder about the z axis with
 * its base at z = 0. Returns 0, or -1 after an error line on stderr. */
static int read_cylinder(const struct world_reader *reader)
{
    struct shape *shape = get_latest_shape(reader);
    if (!shape) {
        return -1;
    }
    if (shape->plane_count) {
        return world_line_report_error(&reader->line, "the object has planes; a cylinder has none");
    }
    shape->kind = SHAPE_CYLINDER;
    return world_line_read_number(&reader->line, 1, 1e-4, COORDINATE_MAX_M, &shape->radius) ||
                   world_line_read_number(&reader->line, 2, 1e-4, COORDINATE_MAX_M, &shape->height)
               ? -1
               : 0;
}

/* Read a pose error X Y Z (metres) RX RY RZ (rotation vector, radians) from six words, starting at word number `first`.
 * Returns 0, or -1 after an error line on stderr. */
static int read_offset(const struct world_reader *reader, int first, struct frame *offset)
{
    double translation[3], rotation[3];
    if (world_line_read_numbers(&reader->line, first, 3, -OFFSET_MAX_M, OFFSET_MAX_M, translation) ||
        world_line_read_numbers(&reader->line, first + 3, 3, -OFFSET_MAX_RAD, OFFSET_MAX_RAD, rotation)) {
        return -1;
    }
    *offset = frame_of_offset(translation, rotation);
    return 0;
}

/* Read a line of a world file: bracket_offset ADDRESS X Y Z RX RY RZ, the actual pose of a bracket relative to its
 * nominal pose. Returns 0, or -1 after an error line on stderr. */
static int read_bracket_offset(const struct world_reader *reader)
{
    const int index = world_reader_find_board(reader, 1);
    return index < 0 ? -1 : read_offset(reader, 2, &reader->world->boards[index].bracket_offset);
}

/* Read a line of a world file: object_offset NAME X Y Z RX RY RZ, the actual pose of an object relative to its nominal
 * pose. Returns 0, or -1 after an error line on stderr. */
static int read_object_offset(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    for (size_t i = 0; reader->line.count > 1 && i < world->object_count; i++) {
        if (strcmp(world->objects[i].shape.name, reader->line.words[1]) == 0) {
            return read_offset(reader, 2, &world->objects[i].offset);
        }
    }
    return world_line_report_error(&reader->line, "no object has this name");
}

/* Read a line of a world file: layer THICKNESS, the height of the layer above the electrodes in metres. Returns 0, or
 * -1 after an error line on stderr. */
static int read_layer(const struct world_reader *reader)
{
    return world_line_read_number(&reader->line, 1, 1e-5, 0.005, &reader->world->layer_thickness);
}

/* Read a line that describes the geometry of the scene. Returns 0, 1 if the line has another keyword, or -1 after an
 * error line on stderr. */
int world_scene_read_line(const struct world_reader *reader)
{
    static const struct {
        const char *keyword;
        int (*read)(const struct world_reader *reader);
    } keywords[] = {
        {"surface", read_surface},
        {"object", read_object},
        {"plane", read_plane},
        {"cylinder", read_cylinder},
        {"margin", read_margin},
        {"layer", read_layer},
        {"bracket_offset", read_bracket_offset},
        {"object_offset", read_object_offset},
    };
    for (size_t i = 0; i < sizeof keywords / sizeof keywords[0]; i++) {
        if (strcmp(reader->line.words[0], keywords[i].keyword) == 0) {
            return keywords[i].read(reader);
        }
    }
    return 1;
}

/* Check after the last line that every board has a pose for all or none of its taxels and that every polyhedron has at
 * least 4 planes. Returns 0, or -1 after an error line on stderr. */
int world_scene_check(const struct world_reader *reader)
{
    const struct world_description *world = reader->world;
    for (size_t i = 0; i < world->board_count; i++) {
        if (world->boards[i].taxel_pose_count && world->boards[i].taxel_pose_count != world->boards[i].taxel_count) {
            fprintf(stderr,
                    "world %s: board 0x%02X: %zu of its %u taxels have a surface line; expected all of them or none\n",
                    reader->line.path, world->boards[i].address, world->boards[i].taxel_pose_count,
                    world->boards[i].taxel_count);
            return -1;
        }
    }
    for (size_t i = 0; i < world->object_count; i++) {
        const struct shape *shape = &world->objects[i].shape;
        if (shape->kind == SHAPE_CONVEX && shape->plane_count < 4) {
            fprintf(stderr, "world %s: object %s: expected at least 4 planes, or a cylinder\n", reader->line.path,
                    shape->name);
            return -1;
        }
    }
    return 0;
}
