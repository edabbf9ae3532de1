#include "emulator/skin/native.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/physics/layer.h"
#include "emulator/skin/skin.h"

#define LOAD_VALUES 43 /* wrench, stiffness and clearance of a board */

struct taxel_contact {
    struct world_description description;
    struct stimulus stimulus;
    struct skin skin;
    struct contact_grip *grips; /* [boards]; NULL: no friction */
};

/* Return the number of cells of a board, including the cells of the bare sheet beside the taxels. */
static size_t count_cells(const struct patch *patch)
{
    return patch->cell_count + patch->margin_count * CELLS_PER_TAXEL;
}

/* Free the state of the friction of all boards. */
static void free_grips(struct taxel_contact *contact)
{
    for (size_t i = 0; contact->grips && i < contact->skin.board_count; i++) {
        free(contact->grips[i].stuck);
        free(contact->grips[i].point);
        free(contact->grips[i].due);
        free(contact->grips[i].untouched);
    }
    free(contact->grips);
    contact->grips = NULL;
}

/* Read a world file and prepare the skins of its boards for contact queries. Returns NULL if out of memory, or after an
 * error line on stderr. */
struct taxel_contact *taxel_contact_open(const char *world_path)
{
    struct taxel_contact *contact = calloc(1, sizeof *contact);
    if (!contact) {
        return NULL;
    }
    layer_init();
    contact->stimulus = (struct stimulus){.kind = STIMULUS_SCENE, .until = VTIME_NEVER, .fd = -1, .name = "contact"};
    if (world_file_read(&contact->description, world_path)) {
        free(contact);
        return NULL;
    }
    contact->stimulus.value_count = STIMULUS_SCENE_VALUES(contact->description.board_count);
    if (skin_init(&contact->skin, &contact->description, &contact->stimulus)) {
        taxel_contact_close(contact);
        return NULL;
    }
    return contact;
}

/* Free a contact that taxel_contact_open() created. NULL is permitted. */
void taxel_contact_close(struct taxel_contact *contact)
{
    if (contact) {
        free_grips(contact);
        skin_free(&contact->skin);
        world_file_free(&contact->description);
        free(contact);
    }
}

/* Return the number of boards in the world file of the contact. */
size_t taxel_contact_boards(const struct taxel_contact *contact)
{
    return contact->skin.board_count;
}

/* Return the number of taxels of all boards in the world file of the contact. */
size_t taxel_contact_taxels(const struct taxel_contact *contact)
{
    size_t taxels = 0;
    for (size_t i = 0; i < contact->skin.board_count; i++) {
        taxels += contact->skin.boards[i].patch.taxel_count;
    }
    return taxels;
}

/* Write the actual pose of the bracket of board number `board` relative to its nominal pose to `offset`: 3 rows of 4
 * values (rotation, translation in metres). */
void taxel_contact_bracket_offset(const struct taxel_contact *contact, size_t board, double *offset)
{
    memcpy(offset, &contact->description.boards[board].bracket_offset, sizeof(struct frame));
}

/* Set the friction coefficient between skin and objects (0: no friction) and forget earlier contacts. Returns 0, or -1
 * if out of memory. */
int taxel_contact_set_friction(struct taxel_contact *contact, double coefficient)
{
    free_grips(contact);
    if (coefficient <= 0.0) {
        return 0;
    }
    contact->grips = calloc(contact->skin.board_count, sizeof *contact->grips);
    for (size_t i = 0; contact->grips && i < contact->skin.board_count; i++) {
        const struct patch *patch = &contact->skin.boards[i].patch;
        const size_t cells = count_cells(patch);
        contact->grips[i].coefficient = coefficient;
        contact->grips[i].stuck = calloc(cells, sizeof *contact->grips[i].stuck);
        contact->grips[i].point = calloc(cells, sizeof *contact->grips[i].point);
        contact->grips[i].due = calloc(patch->taxel_count + patch->margin_count, sizeof *contact->grips[i].due);
        contact->grips[i].untouched = calloc(patch->taxel_count + patch->margin_count, sizeof(double));
        if (!contact->grips[i].stuck || !contact->grips[i].point || !contact->grips[i].due ||
            !contact->grips[i].untouched) {
            free_grips(contact);
        }
    }
    return contact->grips ? 0 : -1;
}

/* Write the normal force (newtons) on each taxel: contact pressure times area, summed over the cells. */
static void write_forces(const struct skin_board *board, bool is_touching, double *force)
{
    for (size_t taxel = 0; taxel < board->patch.taxel_count; taxel++) {
        force[taxel] = 0.0;
        for (size_t i = taxel * CELLS_PER_TAXEL; is_touching && i < (taxel + 1) * CELLS_PER_TAXEL; i++) {
            force[taxel] += layer_contact_pressure(board->compression[i]) * board->patch.cells[i].area;
        }
    }
}

/* Solve the contact of all boards with one object. object: index in the world file, -1 for none. object_pose: nominal
 * pose of the object. bracket_poses: nominal pose of the bracket of each board. A pose has 12 numbers: 3 rows of 4
 * (rotation, translation in metres). Writes to `load` 43 numbers for each board: wrench and stiffness (6 + 36, in the
 * frame of its bracket) and clearance (metres). Writes to `force`, unless it is NULL, the force (newtons) on each
 * taxel. If `advances` is not 0, the points at which the skin sticks to the object are updated (only with friction).
 * Returns the number of boards in contact. */
int taxel_contact_evaluate(struct taxel_contact *contact, int object, const double *object_pose,
                           const double *bracket_poses, double *load, double *force, int advances)
{
    const struct world_description *description = &contact->description;
    const bool has_object = object >= 0 && (size_t)object < description->object_count;
    struct frame object_from_world = frame_identity;
    int touched_boards = 0;
    if (has_object) {
        struct frame nominal_pose;
        memcpy(&nominal_pose, object_pose, sizeof nominal_pose);
        const struct frame world_from_object = frame_product(&nominal_pose, &description->objects[object].offset);
        object_from_world = frame_inverse(&world_from_object);
    }
    for (size_t i = 0; i < contact->skin.board_count; i++) {
        struct skin_board *board = &contact->skin.boards[i];
        struct contact_load sum = {.clearance = INFINITY};
        bool is_touching = false;
        struct contact_grip *grip = contact->grips ? &contact->grips[i] : NULL;
        if (has_object) {
            struct frame nominal_pose;
            if (grip) {
                grip->advances = advances != 0;
            }
            memcpy(&nominal_pose, bracket_poses + 12 * i, sizeof nominal_pose);
            const struct frame bracket = frame_product(&nominal_pose, &description->boards[i].bracket_offset);
            const struct frame object_from_bracket = frame_product(&object_from_world, &bracket);
            is_touching =
                contact_solve(&board->patch, &description->objects[object].shape, &object_from_bracket,
                              description->layer_thickness, 0.0, force ? board->compression : NULL, NULL, &sum, grip);
        }
        memcpy(load + LOAD_VALUES * i, sum.wrench, sizeof sum.wrench);
        memcpy(load + LOAD_VALUES * i + 6, sum.stiffness, sizeof sum.stiffness);
        load[LOAD_VALUES * i + 42] = sum.clearance;
        if (force) {
            write_forces(board, is_touching, force);
            force += board->patch.taxel_count;
        }
        touched_boards += is_touching;
    }
    return touched_boards;
}
