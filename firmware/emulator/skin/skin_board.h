/* The skin of one board: its cells, its loads at two records, and the fields of its taxels. */
#ifndef EMULATOR_SKIN_SKIN_BOARD_H
#define EMULATOR_SKIN_SKIN_BOARD_H

#include <stddef.h>

#include "emulator/geometry/contact.h"
#include "emulator/skin/field.h"
#include "emulator/geometry/patch.h"

struct skin_board {
    struct patch patch;
    struct field field;
    size_t first_taxel;                 /* index of its first taxel in the stimulus */
    struct field_load loads[2];         /* at the records before (loads[earlier]) and after the current time */
    struct taxel_field *before, *after; /* [taxels] at `from` and `until` */
    double *compression;                /* [cells] of the latest contact, metres */
    unsigned unchanged_steps;           /* consecutive steps without a change */
};

#endif
