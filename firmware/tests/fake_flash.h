/* The flash of a PSoC 4200: rows of 128 bytes, erased value 0, a row is erased and then programmed word by word. The
 * power can fail in any write, at any word, and leaves that row partly written. */
#ifndef TAXEL_TESTS_FAKE_FLASH_H
#define TAXEL_TESTS_FAKE_FLASH_H

#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>

#include "emulator/base/random.h"

#define FAKE_FLASH_ROWS 256u
#define FAKE_FLASH_ROW 128u
#define FAKE_FLASH_WORDS 32u
#define FAKE_FLASH_WRITE_US 20000u

/* Content of an interrupted row, with the power cut at word w. */
enum fake_tear {
    FAKE_TEAR_ERASING = 0, /* before w erased, from w on old */
    FAKE_TEAR_PROGRAMMING, /* before w new, from w on erased */
    FAKE_TEAR_OVERWRITING, /* before w new, from w on old */
    FAKE_TEAR_DISTURBED,   /* as programming, and word w is random */
    FAKE_TEAR_ANY,         /* each word old, erased, new or random */
    FAKE_TEAR_COUNT,
};

struct fake_cut {
    unsigned operation; /* the power fails in this write, from 1; 0: never */
    uint8_t tear;       /* enum fake_tear */
    uint8_t word;       /* 0 to FAKE_FLASH_WORDS; the last: the row is written, but the call does not return */
};

struct fake_flash {
    _Alignas(4) uint8_t bytes[FAKE_FLASH_ROWS * FAKE_FLASH_ROW];
    uint32_t wear[FAKE_FLASH_ROWS]; /* writes of each row, including interrupted ones */
    unsigned operations;            /* writes since the cut was planned */
    unsigned cuts;
    unsigned zero_sums; /* rows written whose words add up to zero, other than erased ones */
    bool is_worn_out;   /* writes do nothing and return an error */
    bool is_stuck;      /* writes do nothing and return success */
    struct fake_cut cut;
    jmp_buf *power; /* target of the jump at a power cut */
    struct random_source random;
};

void fake_flash_init(struct fake_flash *flash, uint64_t seed);
/* Plan a power cut in the given write; writes are counted from this call. */
void fake_flash_plan(struct fake_flash *flash, struct fake_cut cut);
/* Write a row. Returns 0, or -1 if the flash is worn out; a power cut jumps to `power` instead. */
int fake_flash_write_row(struct fake_flash *flash, uint16_t row, const uint8_t *bytes);

#endif
