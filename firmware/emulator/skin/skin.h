/* The whole skin over time: what presses each board's cells, and what that makes of each taxel's field.
 *
 * The stimulus says at its records what acts: a force on each taxel, or an object and the brackets' poses, from which the
 * contact is solved here. At every record each taxel gets its field (field.h); between records fields change linearly. Where
 * effects depend on time, or forces pass through the layer's curve, there are steps between records, and after the last one. */
#ifndef EMULATOR_SKIN_SKIN_H
#define EMULATOR_SKIN_SKIN_H

#include "emulator/thread_pool.h"
#include "emulator/skin/contact.h"
#include "emulator/skin/field.h"
#include "emulator/stimulus.h"
#include "emulator/world_file.h"

struct skin_board {
    struct patch patch;
    struct field field;
    size_t first_taxel;                 /* in the stimulus */
    struct field_load loads[2];         /* at the records around now: loads[earlier], and the other one */
    struct taxel_field *before, *after; /* [taxels] at `from` and `until` */
    double *compression;                /* [cells] of the contact that was solved last, metres */
    unsigned quiet;                     /* fields in a row that nothing changed */
};

struct skin {
    const struct world_description *description;
    size_t board_count;
    struct thread_pool *thread_pool;         /* who works on the boards; NULL: the caller alone */
    struct skin_board *boards; /* [board_count]; NULL if the stimulus acts on the front ends directly */
    unsigned earlier;          /* which of each board's loads holds at the stimulus's `from` */
    bool takes_time;           /* some effect changes fields while no load changes */
    bool jump;                 /* the fields at `until` take effect at once */
    vtime from, until;         /* of the fields; until is VTIME_NEVER while they stay */
    vtime next;                /* a step before the next record, or VTIME_NEVER */
    vtime step;
    vtime remembered;          /* what the effects remember is that of this time */
};

/* Returns 0, or -1 after a line on stderr: no memory, or a stimulus of poses for a world without surfaces. */
int skin_init(struct skin *skin, const struct world_description *description, const struct stimulus *stimulus);
void skin_free(struct skin *skin);

/* The record at the stimulus's former `until` has been reached, and the one after it is known or not. */
void skin_advance(struct skin *skin, const struct stimulus *stimulus);

/* A live record has come: it holds from now on already, or replaces what was known of the next one. */
void skin_take_live(struct skin *skin, const struct stimulus *stimulus, vtime now);

/* Virtual time has reached `next`. */
void skin_step(struct skin *skin, const struct stimulus *stimulus);

/* The field of a taxel of a board at a time in [from, until]. */
struct taxel_field skin_field(const struct skin *skin, size_t board, size_t taxel, vtime time);

#endif
