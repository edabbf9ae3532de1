/* What differs between the two chips of the model: PSOC_4200 and PSOC_4100S. A part (parts.h) has one of them. */
#ifndef PSOC4_FAMILY_H
#define PSOC4_FAMILY_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/cortex_m0/cortex_m0.h"

struct psoc;

/* A register function returns false for a register that is not modelled. offset: from the first register of the block;
 * access->value is set by a read and used by a write. */
typedef bool psoc_register_function(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);

struct psoc_block {
    uint32_t base, size;
    psoc_register_function *read, *write; /* write: NULL for a block that cannot be written */
};

struct psoc_family {
    uint32_t ram_size;                       /* bytes; at most PSOC_RAM_SIZE_MAX */
    struct cortex_m0_timing (*timing)(void); /* of the processor, cycles */
    double hz_after_reset;
    uint8_t irq_scb[2], irq_csd;     /* interrupt numbers */
    uint8_t clock_scb[2];            /* numbers of the peripheral clocks */
    uint32_t hsiom_stride;           /* bytes between the select registers of two ports */
    const struct psoc_block *blocks; /* most frequently accessed blocks first */
    unsigned block_count;
    bool configures_flash_clock; /* ROM calls save, set and restore the clocks for a write */
    bool (*sflash_byte)(const struct psoc *psoc, uint32_t offset, uint8_t *value);
    /* Cycles of the processor in a cycle of a peripheral's clock; 0: the clock is off. */
    uint32_t (*clock_divider)(const struct psoc *psoc, unsigned peripheral);
    void (*reset_srss)(struct psoc *psoc, uint32_t causes);
    void (*end_conversion)(struct psoc *psoc);
};

extern const struct psoc_family psoc_4200, psoc_4100s;

#endif
