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
};

void flash_init(struct flash *flash, uint64_t seed, uint8_t address);

/* One write after the other, each begun when the one before has ended. Returns when it will have ended. */
vtime flash_write(struct flash *flash, uint16_t row, const uint8_t *bytes, vtime now);

/* The power fails: what has not begun never happens, what is under way is torn. */
void flash_cut(struct flash *flash, vtime now);

#endif
