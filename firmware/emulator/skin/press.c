#include "emulator/skin/press.h"

#include <string.h>

static struct frame frame_at(const float *values)
{
    struct frame frame;
    for (int i = 0; i < 12; i++) {
        frame.row[i / 4][i % 4] = (double)values[i];
    }
    return frame;
}

static struct frame object_of_bracket_at(const struct world_description *description, const float *values, long object,
                                         size_t index)
{
    const struct frame believed_object = frame_at(values + 1);
    const struct frame believed_bracket = frame_at(values + 13 + 12 * index);
    const struct frame world_of_object = frame_product(&believed_object, &description->objects[object].offset);
    const struct frame world_of_bracket = frame_product(&believed_bracket, &description->boards[index].bracket_offset);
    const struct frame object_of_world = frame_inverse(&world_of_object);
    return frame_product(&object_of_world, &world_of_bracket);
}

void press_scene(struct skin_board *board, const struct world_description *description, size_t index, const float *values,
                 const struct field_load *last, struct field_load *load)
{
    const double thickness = description->layer_thickness, reach = board->field.gap_matters;
    const bool present = values[0] >= 0.0f && values[0] < (float)description->object_count;
    load->object = present ? (long)values[0] : -1;
    load->object_of_bracket = present ? object_of_bracket_at(description, values, load->object, index) : frame_identity;
    load->repeats = load->object == last->object &&
                    memcmp(&load->object_of_bracket, &last->object_of_bracket, sizeof load->object_of_bracket) == 0;
    if (load->repeats && !last->idle) {
        field_load_copy(load, last, &board->patch);
        return;
    }
    const struct shape *shape = present ? &description->objects[load->object].shape : NULL;
    if (!present || contact_is_far(&board->patch, shape, &load->object_of_bracket, thickness + reach)) {
        field_load_clear(load, &board->patch);
        return;
    }
    const bool touches = contact_press(&board->patch, shape, &load->object_of_bracket, thickness, reach, board->compression,
                                       reach > 0.0 ? load->gap : NULL, NULL);
    if (touches || reach > 0.0) {
        field_press(&board->field, touches, board->compression, load);
    } else {
        field_load_clear(load, &board->patch);
    }
}

void press_forces(struct skin_board *board, const float *force, struct field_load *load)
{
    for (size_t taxel = 0; taxel < board->patch.taxel_count; taxel++) {
        if (force[taxel] > 0.0f) {
            field_press_taxels(&board->field, force, board->compression, load);
            return;
        }
    }
    field_load_clear(load, &board->patch);
}
