/* The flash memory of an emulated processor: up to 512 rows of 128 bytes; a write of a row takes 20 ms.
 *
 * A write erases the row and then programs it word by word. If the power fails during the write, the row is torn: a
 * mixture of old, erased, new and undefined words. Contents survive a power loss; writes of each row are counted. */
#ifndef EMULATOR_BASE_FLASH_H
#define EMULATOR_BASE_FLASH_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/base/random.h"
#include "emulator/base/vtime.h"

#define FLASH_ROWS 512u /* of the largest part */
#define FLASH_ROW_SIZE 128u
#define FLASH_WRITE_TIME (20u * VTIME_MS)
#define FLASH_PENDING_WRITES_MAX 8u /* one pass of a firmware's main loop writes fewer rows */
#define FLASH_CUTS_MAX 8u

/* A planned power cut during a write. */
struct flash_cut_plan {
    uint64_t write_number; /* 1 is the first write after the previous cut */
    vtime delay;           /* from the start of the write; 0: the write has no effect */
    vtime off_time;        /* duration of the power loss */
};

/* A power cut that took place. */
struct flash_cut_record {
    uint16_t row;
    vtime delay;                       /* from the start of the write */
    uint8_t new_bytes[FLASH_ROW_SIZE]; /* what the interrupted write was to store */
};

/* A write that has not ended yet, with the content of the row before it. */
struct flash_pending_write {
    vtime begin, end;
    uint16_t row;
    uint8_t before[FLASH_ROW_SIZE];
};

struct flash {
    _Alignas(4) uint8_t bytes[FLASH_ROWS * FLASH_ROW_SIZE];
    uint32_t size;             /* bytes that the part has */
    uint32_t wear[FLASH_ROWS]; /* writes of each row */
    struct flash_pending_write pending[FLASH_PENDING_WRITES_MAX];
    unsigned pending_count; /* writes that a power cut can still tear */
    uint64_t write_count;
    uint64_t torn_count;
    struct random_source random;

    struct flash_cut_plan plans[FLASH_CUTS_MAX];
    unsigned plan_count;
    uint64_t writes_before_cut;                          /* value of write_count at the last cut */
    vtime cut_time, off_time;                            /* of the plan whose write has started; VTIME_NEVER: none */
    struct flash_cut_record cut_records[FLASH_CUTS_MAX]; /* ring buffer of the latest cuts */
    uint64_t cut_count;
};

void flash_init(struct flash *flash, uint32_t size, uint64_t seed, uint8_t address);

/* Write a row of FLASH_ROW_SIZE bytes. Writes run one after another: each starts when the previous one has ended.
 * Returns the time at which this write ends. */
vtime flash_write_row(struct flash *flash, uint16_t row, const uint8_t *bytes, vtime now);

/* Plan a power cut during a later write. Returns false if FLASH_CUTS_MAX cuts are planned. The owner of the flash must
 * switch off the power at `cut_time`. */
bool flash_plan_cut(struct flash *flash, const struct flash_cut_plan *plan);

/* Apply a power failure at `now`: writes that have not started have no effect, and the running write tears its row. */
void flash_cut_power(struct flash *flash, vtime now);

#endif
