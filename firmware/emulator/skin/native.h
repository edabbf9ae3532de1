/* C interface of libtaxel_contact: contact forces of the skin for a caller outside the emulator, from the poses of
 * object and brackets.
 *
 * Integration (for a world file with two boards; poses are 3 rows of 4: rotation and translation in metres):
 *
 *     double load[2][43], bracket_poses[2][12], object_pose[12];
 *     struct taxel_contact *contact = taxel_contact_open("world.txt");
 *     touching = taxel_contact_evaluate(contact, 0, object_pose, &bracket_poses[0][0], &load[0][0], NULL, 1);
 *     use_wrench(&load[0][0]);  // of board 0: force (N) and moment (N m), then the 6 x 6 stiffness, clearance (m)
 *     taxel_contact_close(contact);
 */
#ifndef EMULATOR_SKIN_NATIVE_H
#define EMULATOR_SKIN_NATIVE_H

#include <stddef.h>
#include <stdint.h>

struct taxel_contact;

/* Read a world file with the pose of every taxel. Returns NULL after one line on stderr. */
struct taxel_contact *taxel_contact_open(const char *world_path);
void taxel_contact_close(struct taxel_contact *contact);
size_t taxel_contact_boards(const struct taxel_contact *contact);
size_t taxel_contact_taxels(const struct taxel_contact *contact);

/* Write the actual pose of a board's bracket relative to its nominal pose: 3 rows of 4 numbers (rotation, translation
 * in metres). */
void taxel_contact_bracket_offset(const struct taxel_contact *contact, size_t board, double *offset);

/* Let the skin stick to the object and slide on it with a friction coefficient (0: no friction, the initial value), and
 * forget earlier contacts. Returns 0, or -1 if out of memory. */
int taxel_contact_set_friction(struct taxel_contact *contact, double coefficient);

/* Evaluate the contact of all boards with one object. Returns the number of boards that touch the object.
 *
 * object: index in the file, -1 for none. Nominal poses in the world as 3 rows of 4: object_pose[12],
 * bracket_poses[boards][12]. Written: load[boards][43] on each board, in its actual bracket frame about the origin of
 * that frame: force and moment (6), the 6 x 6 stiffness by rows, and a lower bound of the distance to the object in
 * metres (INFINITY without object); force[taxels] in newtons (may be NULL). advances: not 0: the points where the skin
 * sticks to the object are updated by this contact. */
int taxel_contact_evaluate(struct taxel_contact *contact, int object, const double *object_pose,
                           const double *bracket_poses, double *load, double *force, int advances);

#endif
