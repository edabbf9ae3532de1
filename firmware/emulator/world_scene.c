#include "emulator/world_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FARTHEST_M 100.0
#define UNIT_TOLERANCE 1e-3

static int normalise(const struct world_reader *reader, double vector[3])
{
    const double length = sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    if (fabs(length - 1.0) > UNIT_TOLERANCE) {
        return world_reader_complain(reader, "expected a direction of length 1");
    }
    for (int k = 0; k < 3; k++) {
        vector[k] /= length;
    }
    return 0;
}

/* ADDRESS X Y Z NX NY NZ DX DY DZ */
static int read_place(const struct world_reader *reader, struct taxel_place *place)
{
    return world_reader_numbers(reader, 2, 3, -FARTHEST_M, FARTHEST_M, place->position) ||
                   world_reader_numbers(reader, 5, 3, -1.1, 1.1, place->normal) ||
                   world_reader_numbers(reader, 8, 3, -1.1, 1.1, place->distal) || normalise(reader, place->normal) ||
                   normalise(reader, place->distal)
               ? -1
               : 0;
}

/* margin, then as surface: a square of bare sheet, one pitch wide, of that board */
static int read_margin(const struct world_reader *reader)
{
    const int index = world_reader_board(reader, 1);
    struct taxel_place place;
    if (index < 0 || read_place(reader, &place)) {
        return -1;
    }
    struct board_description *board = &reader->world->boards[index];
    if (board->margin_count == WORLD_MARGINS_MAX) {
        return world_reader_complain(reader, "too much bare sheet on that board");
    }
    struct taxel_place *margins = realloc(board->margins, (board->margin_count + 1) * sizeof *margins);
    if (!margins) {
        return world_reader_complain(reader, "out of memory");
    }
    board->margins = margins;
    board->margins[board->margin_count++] = place;
    return 0;
}

/* surface ADDRESS X Y Z NX NY NZ DX DY DZ: the next taxel of that board */
static int read_surface(const struct world_reader *reader)
{
    const int index = world_reader_board(reader, 1);
    if (index < 0) {
        return -1;
    }
    struct board_description *board = &reader->world->boards[index];
    struct taxel_place place;
    if (board->placed == board->taxel_count) {
        return world_reader_complain(reader, "that board has no more taxels");
    }
    if (!board->places) {
        board->places = calloc(board->taxel_count, sizeof *board->places);
        if (!board->places) {
            return world_reader_complain(reader, "out of memory");
        }
    }
    if (read_place(reader, &place)) {
        return -1;
    }
    board->places[board->placed++] = place;
    return 0;
}

/* object NAME X Y Z RADIUS: a new object, and a ball that holds it */
static int read_object(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    double radius;
    if (world->object_count == WORLD_OBJECTS_MAX) {
        return world_reader_complain(reader, "too many objects");
    }
    if (reader->count < 2 || strlen(reader->words[1]) >= SHAPE_NAME_MAX) {
        return world_reader_complain(reader, "an object needs a name of at most 39 characters");
    }
    struct object_description *objects = realloc(world->objects, (world->object_count + 1) * sizeof *objects);
    if (!objects) {
        return world_reader_complain(reader, "out of memory");
    }
    world->objects = objects;
    struct object_description *object = &objects[world->object_count];
    memset(object, 0, sizeof *object);
    object->offset = frame_identity;
    if (world_reader_numbers(reader, 2, 3, -FARTHEST_M, FARTHEST_M, object->shape.centre) ||
        world_reader_number(reader, 5, 1e-4, FARTHEST_M, &radius)) {
        return -1;
    }
    object->shape.bound = radius;
    memcpy(object->shape.name, reader->words[1], strlen(reader->words[1]) + 1);
    world->object_count++;
    return 0;
}

static struct shape *latest_shape(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    if (!world->object_count) {
        (void)world_reader_complain(reader, "an object comes before its shape");
        return NULL;
    }
    return &world->objects[world->object_count - 1].shape;
}

/* plane NX NY NZ OFFSET: the latest object lies where normal . p <= offset */
static int read_plane(const struct world_reader *reader)
{
    struct shape *shape = latest_shape(reader);
    double plane[4];
    if (!shape) {
        return -1;
    }
    if (shape->plane_count == SHAPE_PLANES_MAX || shape->kind == SHAPE_CYLINDER) {
        return world_reader_complain(reader, "too many planes, or planes on a cylinder");
    }
    if (world_reader_numbers(reader, 1, 3, -1.1, 1.1, plane) ||
        world_reader_number(reader, 4, -FARTHEST_M, FARTHEST_M, &plane[3]) || normalise(reader, plane)) {
        return -1;
    }
    memcpy(shape->planes[shape->plane_count++], plane, sizeof plane);
    return 0;
}

/* cylinder RADIUS HEIGHT */
static int read_cylinder(const struct world_reader *reader)
{
    struct shape *shape = latest_shape(reader);
    if (!shape) {
        return -1;
    }
    if (shape->plane_count) {
        return world_reader_complain(reader, "the object has planes already");
    }
    shape->kind = SHAPE_CYLINDER;
    return world_reader_number(reader, 1, 1e-4, FARTHEST_M, &shape->radius) ||
                   world_reader_number(reader, 2, 1e-4, FARTHEST_M, &shape->height)
               ? -1
               : 0;
}

/* X Y Z (metres) RX RY RZ (rotation vector, radians) from word `first` on */
static int read_offset(const struct world_reader *reader, int first, struct frame *offset)
{
    double translation[3], rotation[3];
    if (world_reader_numbers(reader, first, 3, -1.0, 1.0, translation) ||
        world_reader_numbers(reader, first + 3, 3, -3.2, 3.2, rotation)) {
        return -1;
    }
    *offset = frame_of_offset(translation, rotation);
    return 0;
}

static int read_bracket_offset(const struct world_reader *reader)
{
    const int index = world_reader_board(reader, 1);
    return index < 0 ? -1 : read_offset(reader, 2, &reader->world->boards[index].bracket_offset);
}

static int read_object_offset(const struct world_reader *reader)
{
    struct world_description *world = reader->world;
    for (size_t i = 0; reader->count > 1 && i < world->object_count; i++) {
        if (strcmp(world->objects[i].shape.name, reader->words[1]) == 0) {
            return read_offset(reader, 2, &world->objects[i].offset);
        }
    }
    return world_reader_complain(reader, "no object has that name");
}

static int read_layer(const struct world_reader *reader)
{
    return world_reader_number(reader, 1, 1e-5, 0.005, &reader->world->layer_thickness);
}

int world_scene_read_line(const struct world_reader *reader)
{
    static const struct {
        const char *word;
        int (*read)(const struct world_reader *reader);
    } words[] = {
        {"surface", read_surface},   {"object", read_object},
        {"plane", read_plane},       {"cylinder", read_cylinder},
        {"margin", read_margin},     {"layer", read_layer},       {"bracket_offset", read_bracket_offset},
        {"object_offset", read_object_offset},
    };
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        if (strcmp(reader->words[0], words[i].word) == 0) {
            return words[i].read(reader);
        }
    }
    return 1;
}

int world_scene_check(const struct world_reader *reader)
{
    const struct world_description *world = reader->world;
    for (size_t i = 0; i < world->board_count; i++) {
        if (world->boards[i].placed && world->boards[i].placed != world->boards[i].taxel_count) {
            fprintf(stderr, "world %s: board 0x%02X: %zu of its %u taxels have a place; give each one a surface line\n",
                    reader->path, world->boards[i].address, world->boards[i].placed, world->boards[i].taxel_count);
            return -1;
        }
    }
    for (size_t i = 0; i < world->object_count; i++) {
        const struct shape *shape = &world->objects[i].shape;
        if (shape->kind == SHAPE_CONVEX && shape->plane_count < 4) {
            fprintf(stderr, "world %s: object %s: a shape needs 4 planes at least, or a cylinder\n", reader->path, shape->name);
            return -1;
        }
    }
    return 0;
}
