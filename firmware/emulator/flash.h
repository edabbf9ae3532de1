/* The flash of an emulated processor: 256 rows of 128 bytes, 20 ms a write. A row is erased and then programmed word after
 * word; when the power fails meanwhile, the row is left torn. Contents stay, wear is counted. */
#ifndef EMULATOR_FLASH_H
#define EMULATOR_FLASH_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/random.h"
#include "emulator/vtime.h"

#define FLASH_ROWS 256u
#define FLASH_ROW 128u
#define FLASH_WRITE (20u * VTIME_MS)
#define FLASH_WRITES_UNDER_WAY 8u /* one pass of a main loop asks for fewer */
#define FLASH_CUTS_MAX 8u

/* A power cut that waits for a write: the first has number 1, counted from the cut before this one. */
struct flash_cut_plan {
    uint64_t operation;
    vtime after; /* of its beginning; 0: it never happens */
    vtime off;   /* how long there is no power */
};

/* What a planned cut has struck. */
struct flash_cut_made {
    uint16_t row;
    vtime after;
    uint8_t wanted[FLASH_ROW]; /* what was to be written */
};

struct flash_write {
    vtime begin, end;
    uint16_t row;
    uint8_t before[FLASH_ROW];
};

struct flash {
    _Alignas(4) uint8_t bytes[FLASH_ROWS * FLASH_ROW];
    uint32_t wear[FLASH_ROWS];
    struct flash_write writes[FLASH_WRITES_UNDER_WAY];
    unsigned count; /* writes that may still be cut */
    uint64_t operations;
    uint64_t torn;
    struct random_source random;

    struct flash_cut_plan plans[FLASH_CUTS_MAX];
    unsigned plan_count;
    uint64_t counted_from; /* operations before the last cut */
    vtime cut_at, off;     /* of the plan whose write has begun; VTIME_NEVER: none */
    struct flash_cut_made made[FLASH_CUTS_MAX]; /* the latest, in turn */
    uint64_t made_count;
};

void flash_init(struct flash *flash, uint64_t seed, uint8_t address);

/* One write after the other, each begun when the one before has ended. Returns when it will have ended. */
vtime flash_write(struct flash *flash, uint16_t row, const uint8_t *bytes, vtime now);

/* Cut the power in a write to come. Returns false if too many cuts wait already. Whoever has the power looks at cut_at. */
bool flash_plan_cut(struct flash *flash, const struct flash_cut_plan *plan);

/* The power fails: what has not begun never happens, what is under way is torn. */
void flash_cut(struct flash *flash, vtime now);

#endif
