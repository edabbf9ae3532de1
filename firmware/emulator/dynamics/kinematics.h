/* Kinematics of a hand with skin: poses of its links and brackets, and the motion of the brackets. */
#ifndef EMULATOR_DYNAMICS_KINEMATICS_H
#define EMULATOR_DYNAMICS_KINEMATICS_H

#include <stddef.h>
#include <stdint.h>

#include "emulator/dynamics/free_object.h"
#include "emulator/geometry/frame.h"

#define LINKS_MAX 64
#define JOINTS_MAX 32 /* revolute joints */
#define BOARDS_MAX 64
#define COORDINATES_MAX (JOINTS_MAX + OBJECT_DOF)

/* Tree of links. Link 0 is the wrist; every other link follows its parent in the arrays. Joints are revolute. */
struct kinematic_tree {
    size_t link_count, joint_count, board_count;
    const int32_t *parent;        /* [link_count], link that carries a link; unused for link 0 */
    const int32_t *joint;         /* [link_count], joint that moves a link; -1: fixed */
    const struct frame *origin;   /* [link_count], pose of a link in the frame of its parent at joint angle 0 */
    const double (*axis)[3];      /* [joint_count], unit vector in the frame of the link that the joint moves */
    const int32_t *board_link;    /* [board_count] */
    const struct frame *bracket;  /* [board_count], nominal pose of a bracket on its link */
    const struct frame *mounting; /* [board_count], pose of the mounted bracket relative to its nominal pose */
};

/* Motion of one bracket relative to the object, in the true frame of the bracket, for a unit speed of each coordinate:
 * translation, then rotation. Only coordinates that move the bracket or the object are listed. */
struct bracket_motion {
    size_t count;
    size_t coordinate[COORDINATES_MAX]; /* joints first, then the six coordinates of the object */
    double twist[COORDINATES_MAX][6];
};

/* Compute the poses of all links in the world. wrist: pose of link 0. angles[joint_count]: radians. */
void kinematics_links(const struct kinematic_tree *tree, const struct frame *wrist, const double *angles,
                      struct frame *links);

/* Compute the nominal poses of all brackets in the world from the poses of the links. */
void kinematics_brackets(const struct kinematic_tree *tree, const struct frame *links, struct frame *brackets);

/* Compute the motion of the bracket of board number `board`, whose true pose is `bracket`, relative to an object with
 * the centre of mass `centre`. */
void kinematics_motion(const struct kinematic_tree *tree, size_t board, const struct frame *links,
                       const struct frame *bracket, const double centre[3], struct bracket_motion *motion);

/* Rotate a vector from the world to the frame of a bracket. */
void kinematics_to_bracket(const struct frame *bracket, const double in[3], double out[3]);

#endif
