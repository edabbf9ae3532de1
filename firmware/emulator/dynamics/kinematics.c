#include "emulator/dynamics/kinematics.h"

#include "emulator/geometry/vector.h"

/* Compute the poses of all links in the world from the pose of the wrist and the joint angles (radians). */
void kinematics_links(const struct kinematic_tree *tree, const struct frame *wrist, const double *angles,
                      struct frame *links)
{
    const double nothing[3] = {0.0, 0.0, 0.0};
    links[0] = *wrist;
    for (size_t link = 1; link < tree->link_count; link++) {
        links[link] = frame_product(&links[tree->parent[link]], &tree->origin[link]);
        const int32_t joint = tree->joint[link];
        if (joint >= 0) {
            const double *axis = tree->axis[joint], angle = angles[joint];
            const double turn[3] = {angle * axis[0], angle * axis[1], angle * axis[2]};
            const struct frame rotation = frame_of_offset(nothing, turn);
            links[link] = frame_product(&links[link], &rotation);
        }
    }
}

/* Compute the nominal poses (without mounting errors) of all brackets, the mounts of the boards, in the world from the
 * poses of the links. */
void kinematics_brackets(const struct kinematic_tree *tree, const struct frame *links, struct frame *brackets)
{
    for (size_t board = 0; board < tree->board_count; board++) {
        brackets[board] = frame_product(&links[tree->board_link[board]], &tree->bracket[board]);
    }
}

/* Rotate a vector from the world to the frame of a bracket. */
void kinematics_to_bracket(const struct frame *bracket, const double in[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        out[k] = bracket->row[0][k] * in[0] + bracket->row[1][k] * in[1] + bracket->row[2][k] * in[2];
    }
}

/* Append the motion of the bracket for a unit speed of one coordinate. translation (m/s) and rotation (rad/s): in the
 * world; they are stored in the frame of the bracket. */
static void append(struct bracket_motion *motion, size_t coordinate, const struct frame *bracket,
                   const double translation[3], const double rotation[3])
{
    double *twist = motion->twist[motion->count];
    motion->coordinate[motion->count++] = coordinate;
    kinematics_to_bracket(bracket, translation, &twist[0]);
    kinematics_to_bracket(bracket, rotation, &twist[3]);
}

/* Compute the motion of a bracket relative to the object for a unit speed of each joint that carries the bracket, and
 * of each coordinate of the object. links: poses of all links. bracket: pose of the mounted bracket. centre: centre of
 * mass of the object. All are in the world, lengths in metres. */
void kinematics_motion(const struct kinematic_tree *tree, size_t board, const struct frame *links,
                       const struct frame *bracket, const double centre[3], struct bracket_motion *motion)
{
    const double nothing[3] = {0.0, 0.0, 0.0};
    double arm[3], translation[3];
    motion->count = 0;
    for (int32_t link = tree->board_link[board]; link > 0; link = tree->parent[link]) {
        const int32_t joint = tree->joint[link];
        if (joint >= 0) {
            double axis[3];
            frame_direction(&links[link], tree->axis[joint], axis);
            for (int k = 0; k < 3; k++) {
                arm[k] = bracket->row[k][3] - links[link].row[k][3];
            }
            cross(axis, arm, translation);
            append(motion, (size_t)joint, bracket, translation, axis);
        }
    }
    for (int k = 0; k < 3; k++) {
        arm[k] = bracket->row[k][3] - centre[k];
    }
    for (size_t k = 0; k < 3; k++) {
        double unit[3] = {0.0, 0.0, 0.0};
        unit[k] = -1.0; /* the motion of the object counts against that of the bracket */
        append(motion, tree->joint_count + k, bracket, unit, nothing);
    }
    for (size_t k = 0; k < 3; k++) {
        double unit[3] = {0.0, 0.0, 0.0};
        unit[k] = -1.0;
        cross(unit, arm, translation);
        append(motion, tree->joint_count + 3 + k, bracket, translation, unit);
    }
}
