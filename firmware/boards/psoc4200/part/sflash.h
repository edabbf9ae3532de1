/* Supervisory flash: values measured by the manufacturer and written into each die.
 * Source: Registers TRM (001-85847), chapter SFLASH; values as in the manufacturer's device header for this part. */
#ifndef PART_SFLASH_H
#define PART_SFLASH_H

#include <stddef.h>
#include <stdint.h>

struct sflash_regs { /* read-only */
    uint8_t other_a[0x162];
    uint8_t csd_trim1; /* IDAC trims for CapSense: source */
    uint8_t csd_trim2; /* sink */
    uint8_t other_b[0x14];
    uint8_t die[8]; /* lot (3), wafer, x, y, sort, minor */
    uint8_t other_c[0x4C];
    uint8_t imo_abs_48mhz;
    uint8_t imo_tmpco_48mhz;
    uint8_t other_d[2];
    uint8_t imo_trim[46]; /* of 3 MHz, 4 MHz ... 48 MHz */
};

_Static_assert(offsetof(struct sflash_regs, csd_trim1) == 0x162, "SFLASH_CSD_TRIM1_CSD is at 0x0FFFF162");
_Static_assert(offsetof(struct sflash_regs, die) == 0x178, "SFLASH_DIE_LOT0 is at 0x0FFFF178");
_Static_assert(offsetof(struct sflash_regs, imo_abs_48mhz) == 0x1CC, "SFLASH_IMO_ABS4 is at 0x0FFFF1CC");
_Static_assert(offsetof(struct sflash_regs, imo_trim) == 0x1D0, "SFLASH_IMO_TRIM00 is at 0x0FFFF1D0");

#define SFLASH ((const struct sflash_regs *)0x0FFFF000u)

/* 48 MHz is the last of the five entries ABS0..4 and TMPCO0..4 (confirm). */

#endif
