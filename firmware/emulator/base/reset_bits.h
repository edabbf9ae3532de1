/* A reset cause of the protocol as bits of the register RES_CAUSE of a PSoC 4200
 * (boards/psoc4200/part/srss.h). */
#ifndef EMULATOR_BASE_RESET_BITS_H
#define EMULATOR_BASE_RESET_BITS_H

#include "generated/taxel_protocol.h"

/* Return the bits of RES_CAUSE for a reset cause of the protocol. */
static inline uint32_t reset_bits(uint8_t cause)
{
    switch (cause) {
    case TAXEL_RESET_CAUSE_WATCHDOG:
        return 1u << 0;
    case TAXEL_RESET_CAUSE_COMMAND:
        return 1u << 4;
    case TAXEL_RESET_CAUSE_BROWN_OUT:
        return 1u << 5;
    default:
        return 0; /* a power-on reset sets no bit */
    }
}

#endif
