/* CPU subsystem: location of the vectors, calls into the supervisory ROM, wait states of the flash. Source: manufacturer's
 * register header of this block (CPUSS version 3); wait states as in the manufacturer's driver. */
#ifndef PART_CPUSS_H
#define PART_CPUSS_H

#include <stddef.h>
#include <stdint.h>

struct cpuss_regs {
    volatile uint32_t config;
    volatile uint32_t sysreq;
    volatile uint32_t sysarg;
    uint32_t other[9];
    volatile uint32_t flash_ctl;
};

_Static_assert(offsetof(struct cpuss_regs, sysreq) == 0x04, "CPUSS_SYSREQ is at 0x40100004");
_Static_assert(offsetof(struct cpuss_regs, sysarg) == 0x08, "CPUSS_SYSARG is at 0x40100008");
_Static_assert(offsetof(struct cpuss_regs, flash_ctl) == 0x30, "CPUSS_FLASH_CTL is at 0x40100030");

#define CPUSS ((struct cpuss_regs *)0x40100000u)

#define CPUSS_CONFIG_VECS_IN_RAM (1u << 0) /* exceptions take their vectors from 0x20000000 on */

/* The low 16 bits are the opcode; the ROM runs in an NMI and then clears this bit. */
#define CPUSS_SYSREQ_START (1u << 31)

/* Wait states of the flash: 0 up to 16 MHz, 1 up to 32 MHz, 2 up to 48 MHz. */
#define CPUSS_FLASH_CTL_WAIT_STATES(count) (count)
#define CPUSS_FLASH_CTL_PREFETCH (1u << 4)

#endif
