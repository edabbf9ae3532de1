/* Contact for a caller outside the emulator: how the world's skin pushes back, given where object and brackets are. */
#ifndef EMULATOR_SKIN_NATIVE_H
#define EMULATOR_SKIN_NATIVE_H

#include <stddef.h>
#include <stdint.h>

struct taxel_contact;

/* Read a world file that places every taxel. NULL after one line on stderr. */
struct taxel_contact *taxel_contact_open(const char *world_path);
void taxel_contact_close(struct taxel_contact *contact);
size_t taxel_contact_boards(const struct taxel_contact *contact);
size_t taxel_contact_taxels(const struct taxel_contact *contact);

/* Where a board's bracket and an object truly are, in the frames in which they are believed to be: 3 rows of 4. */
void taxel_contact_bracket_offset(const struct taxel_contact *contact, size_t board, double *offset);
void taxel_contact_object_offset(const struct taxel_contact *contact, size_t object, double *offset);

/* `object`: its number in the file, -1 for none. Poses are 3 rows of 4 in the world: object_pose[12], bracket_poses[boards][12],
 * as they are believed. Written: load[boards][42], on the board, in its true bracket frame about that frame's origin: force and
 * moment (6), then the 6 x 6 stiffness by rows; force[taxels] newtons (may be NULL). Returns how many boards are touched. */
int taxel_contact_evaluate(struct taxel_contact *contact, int object, const double *object_pose, const double *bracket_poses,
                           double *load, double *force);

#endif
