/* CPU subsystem: location of the vectors, and calls into the supervisory ROM. Source: PSoC 4100/4200 Registers TRM
 * (001-85847), CPUSS_CONFIG, CPUSS_SYSREQ, CPUSS_SYSARG; values as in the manufacturer's device header for this
 * part. */
#ifndef PART_CPUSS_H
#define PART_CPUSS_H

#include <stddef.h>
#include <stdint.h>

struct cpuss_regs {
    volatile uint32_t config;
    volatile uint32_t sysreq;
    volatile uint32_t sysarg;
};

_Static_assert(offsetof(struct cpuss_regs, sysreq) == 0x04, "CPUSS_SYSREQ is at 0x40000004");
_Static_assert(offsetof(struct cpuss_regs, sysarg) == 0x08, "CPUSS_SYSARG is at 0x40000008");

#define CPUSS ((struct cpuss_regs *)0x40000000u)

#define CPUSS_CONFIG_VECS_IN_RAM (1u << 0) /* exceptions take their vectors from 0x20000000 on */

/* The low 16 bits are the opcode; the ROM runs in an NMI and then clears this bit. */
#define CPUSS_SYSREQ_START (1u << 31)

#endif
