#include "emulator/skin/board_load.h"

#include <string.h>

/* Convert 12 numbers (three rows of rotation and translation, metres) to a rigid transform. */
static struct frame read_frame(const float *values)
{
    struct frame frame;
    for (int i = 0; i < 12; i++) {
        frame.row[i / 4][i % 4] = (double)values[i];
    }
    return frame;
}

/* Return the pose of the bracket of a board in the frame of the object, from the nominal poses in a record of a scene
 * (object number, pose of the object, poses of the brackets) and the errors of mounting and placement that the world
 * file states. */
static struct frame compute_bracket_in_object(const struct world_description *description, const float *values,
                                              long object, size_t index)
{
    const struct frame nominal_object = read_frame(values + 1);
    const struct frame nominal_bracket = read_frame(values + 13 + 12 * index);
    const struct frame world_from_object = frame_product(&nominal_object, &description->objects[object].offset);
    const struct frame world_from_bracket = frame_product(&nominal_bracket, &description->boards[index].bracket_offset);
    const struct frame object_from_world = frame_inverse(&world_from_object);
    return frame_product(&object_from_world, &world_from_bracket);
}

/* Compute the load of a board from the poses in a record of a scene. The previous load is copied if no pose changed;
 * the contact is solved only if the object is near enough to touch or to be sensed through the air. */
void board_load_from_scene(struct skin_board *board, const struct world_description *description, size_t index,
                           const float *values, const struct field_load *last, struct field_load *load)
{
    const double thickness = description->layer_thickness, reach = board->field.proximity_reach_m;
    const bool has_object = values[0] >= 0.0f && values[0] < (float)description->object_count;
    load->object = has_object ? (long)values[0] : -1;
    load->object_from_bracket =
        has_object ? compute_bracket_in_object(description, values, load->object, index) : frame_identity;
    /* Bytes are compared. Equal poses with different bytes (0.0 and -0.0) only cause one more computation of the
     * load. */
    load->equals_previous =
        load->object == last->object && /* NOLINTNEXTLINE(bugprone-suspicious-memory-comparison,cert-*) */
        memcmp(&load->object_from_bracket, &last->object_from_bracket, sizeof load->object_from_bracket) == 0;
    if (load->equals_previous && !last->is_unloaded) {
        field_load_copy(load, last, &board->patch);
        return;
    }
    const struct shape *shape = has_object ? &description->objects[load->object].shape : NULL;
    if (!has_object || contact_is_far(&board->patch, shape, &load->object_from_bracket, thickness + reach)) {
        field_load_clear(load, &board->patch);
        return;
    }
    const bool is_touching = contact_solve(&board->patch, shape, &load->object_from_bracket, thickness, reach,
                                           board->compression, reach > 0.0 ? load->gap : NULL, NULL, NULL);
    if (is_touching || reach > 0.0) {
        field_load_contact(&board->field, is_touching, board->compression, load);
    } else {
        field_load_clear(load, &board->patch);
    }
}

/* Compute the load of a board from a force (newtons) on each of its taxels; a board without any force is cleared
 * without computation. */
void board_load_from_forces(struct skin_board *board, const float *force, struct field_load *load)
{
    for (size_t taxel = 0; taxel < board->patch.taxel_count; taxel++) {
        if (force[taxel] > 0.0f) {
            field_load_forces(&board->field, force, board->compression, load);
            return;
        }
    }
    field_load_clear(load, &board->patch);
}
