/* Skin of all boards over time: from the stimulus to the field of each taxel.
 *
 * A record of the stimulus contains a force per taxel, or an object and the poses of the brackets, from which the
 * contact is solved here. At every record each taxel receives its field (field.h); between records fields change
 * linearly. If effects depend on time, or if forces pass through the layer's curve, additional steps are computed
 * between records and after the last record. */
#ifndef EMULATOR_SKIN_SKIN_H
#define EMULATOR_SKIN_SKIN_H

#include "emulator/base/thread_pool.h"
#include "emulator/skin/skin_board.h"
#include "emulator/skin/stimulus.h"
#include "emulator/world_file/world_file.h"

struct skin {
    const struct world_description *description;
    size_t board_count;
    struct thread_pool *thread_pool; /* threads that compute the boards; NULL: the caller's thread alone */
    struct skin_board *boards;       /* [board_count]; NULL if the stimulus acts on the front ends directly */
    unsigned earlier;                /* index into `loads` of the load at the stimulus's `from` */
    bool is_dynamic;                 /* an effect changes fields while no load changes */
    bool is_step;                    /* the fields at `until` take effect in a step */
    vtime from, until;               /* times of the fields; until is VTIME_NEVER while the fields are constant */
    vtime next;                      /* end of the step before the next record, or VTIME_NEVER */
    vtime step;
    vtime history_time; /* time to which the load history of the effects is advanced */
};

/* Return 0, or -1 after one line on stderr: out of memory, or a stimulus of poses for a world without taxel poses. */
int skin_init(struct skin *skin, const struct world_description *description, const struct stimulus *stimulus);
void skin_free(struct skin *skin);

/* Begin the interval that follows the record at the stimulus's former `until`, whether or not the following record is
 * known. */
void skin_advance(struct skin *skin, const struct stimulus *stimulus);

/* Apply a live record: it takes effect now, or replaces the known next record. */
void skin_apply_live_record(struct skin *skin, const struct stimulus *stimulus, vtime now);

/* Begin the next step when virtual time has reached `next`. */
void skin_step(struct skin *skin, const struct stimulus *stimulus);

/* Return the field of a taxel of a board at a time in [from, until]. */
struct taxel_field skin_field(const struct skin *skin, size_t board, size_t taxel, vtime time);

#endif
