/* CapSense block of the first generation, and its two current sources. Source: Registers TRM (001-85847), chapter
 * CSD; values as in the manufacturer's device header for this part. The measurement of a mutual capacitance follows
 * public CapSense sources for the blocks before the fourth generation. These sources use two integration capacitors and
 * a filter (CONFIG bits 4 and 3) on every part of the first generation, and leave the reference buffer on; so do the
 * original boards. The accuracy with one capacitor and without these bits is not verified (confirm). */
#ifndef PART_CSD_H
#define PART_CSD_H

#include <stddef.h>
#include <stdint.h>

struct csd_regs {
    volatile uint32_t id;
    volatile uint32_t config;
    volatile uint32_t idac;
    volatile uint32_t counter;
    volatile uint32_t status;
    volatile uint32_t intr;
    volatile uint32_t intr_set;
};

_Static_assert(offsetof(struct csd_regs, config) == 0x04, "CSD_CONFIG is at 0x40080004");
_Static_assert(offsetof(struct csd_regs, idac) == 0x08, "CSD_IDAC is at 0x40080008");
_Static_assert(offsetof(struct csd_regs, counter) == 0x0C, "CSD_COUNTER is at 0x4008000C");
_Static_assert(offsetof(struct csd_regs, intr) == 0x14, "CSD_INTR is at 0x40080014");

#define CSD ((struct csd_regs *)0x40080000u)
#define CSD_TRIM1 (*(volatile uint32_t *)0x4008FF00u) /* IDACs as sources: 4 bits each */

#define CSD_CONFIG_SAMPLE_FILTER (1u << 3)
#define CSD_CONFIG_TWO_CAPACITORS (1u << 4) /* two integration capacitors, CintA and CintB */
#define CSD_CONFIG_SENSE_COMP_BW_HIGH (1u << 11)
#define CSD_CONFIG_SENSE_EN (1u << 12)  /* the sense clock drives the TX line, and the current source balances */
#define CSD_CONFIG_REFBUF_EN (1u << 13) /* the reference buffer charges the capacitor */
#define CSD_CONFIG_MUTUAL_CAP (1u << 18)
#define CSD_CONFIG_SENSE_COMP_EN (1u << 19)
#define CSD_CONFIG_REFBUF_OUT_AMUX_B (1u << 21)
#define CSD_CONFIG_SENSE_IN_AMUX_A (1u << 22) /* the comparator input is analog bus A */
#define CSD_CONFIG_REFBUF_DRIVE_3 (3u << 23)
#define CSD_CONFIG_ENABLE (1u << 31)

/* On while the comparator requests it; bits 0 to 7: code, 1.2 uA each in range 4x. */
#define CSD_IDAC_IDAC1_VARIABLE (2u << 8)

#define CSD_COUNTER_PERIOD(clocks) ((uint32_t)(clocks) << 16) /* a write starts a conversion; the counter counts down */
#define CSD_COUNTER_COUNT 0xFFFFu                             /* sample clocks in which the current source was on */

#define CSD_STATUS_SENSE (1u << 1)
#define CSD_STATUS_SAMPLE (1u << 3)

#define CSD_INTR_CSD (1u << 0) /* the period is over; writing 1 clears the bit */

#endif
