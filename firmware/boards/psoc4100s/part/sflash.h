/* Supervisory flash: values measured by the manufacturer and written into each die. Source: manufacturer's register
 * header for parts with rows of 128 bytes; the position of the die's data is that of other parts of the family (confirm). */
#ifndef PART_SFLASH_H
#define PART_SFLASH_H

#include <stddef.h>
#include <stdint.h>

struct sflash_regs { /* read-only */
    uint8_t other_a[0x178];
    uint8_t die[8]; /* lot (3), wafer, x, y, sort, minor (confirm) */
    uint8_t other_b[0x4C];
    uint8_t imo_tctrim[25]; /* temperature coefficient of 24 MHz, 25 MHz ... 48 MHz */
    uint8_t imo_trim[25];   /* offset of 24 MHz, 25 MHz ... 48 MHz */
};

_Static_assert(offsetof(struct sflash_regs, die) == 0x178, "SFLASH_DIE_LOT0 is at 0x0FFFF178");
_Static_assert(offsetof(struct sflash_regs, imo_tctrim) == 0x1CC, "SFLASH_IMO_TCTRIM_LT0 is at 0x0FFFF1CC");
_Static_assert(offsetof(struct sflash_regs, imo_trim) == 0x1E5, "SFLASH_IMO_TRIM_LT0 is at 0x0FFFF1E5");

#define SFLASH ((const struct sflash_regs *)0x0FFFF000u)

#endif
