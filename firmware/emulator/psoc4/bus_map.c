/* Accesses of the processor to the registers of the peripheral blocks. */
#include "emulator/psoc4/internal.h"

/* Read the register at `offset` of the serial block SCB0. Returns false if the register does not exist. */
bool psoc_scb0_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_read(psoc, &psoc->scb[0], offset, access);
}

/* Write the register at `offset` of the serial block SCB0. Returns false if the register does not exist. */
bool psoc_scb0_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_write(psoc, &psoc->scb[0], offset, access);
}

/* Read the register at `offset` of the serial block SCB1. Returns false if the register does not exist. */
bool psoc_scb1_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_read(psoc, &psoc->scb[1], offset, access);
}

/* Write the register at `offset` of the serial block SCB1. Returns false if the register does not exist. */
bool psoc_scb1_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_write(psoc, &psoc->scb[1], offset, access);
}

/* Return the peripheral block at an address, or NULL. */
static const struct psoc_block *block_at(const struct psoc *psoc, uint32_t address)
{
    const struct psoc_family *family = psoc_family(psoc);
    for (unsigned i = 0; i < family->block_count; i++) {
        if (address - family->blocks[i].base < family->blocks[i].size) {
            return &family->blocks[i];
        }
    }
    return NULL;
}

/* Read a peripheral register for the processor. A register that the emulator does not model is reported and stops the
 * processor. Returns CORTEX_M0_ERROR (bus fault) for an address without a block. */
enum cortex_m0_bus_status psoc_on_read(void *context, struct cortex_m0_access *access)
{
    struct psoc *psoc = context;
    const struct psoc_block *block = block_at(psoc, access->address);
    if (!block) {
        return CORTEX_M0_ERROR; /* bus fault, as on silicon */
    }
    if (!block->read(psoc, access->address - block->base, access)) {
        psoc_report_unmodelled(psoc, "reads", access->address);
    }
    return CORTEX_M0_OK;
}

/* Write a peripheral register for the processor. A register that the emulator does not model is reported and stops the
 * processor. Returns CORTEX_M0_ERROR (bus fault) for an address without a writable block. */
enum cortex_m0_bus_status psoc_on_write(void *context, struct cortex_m0_access *access)
{
    struct psoc *psoc = context;
    const struct psoc_block *block = block_at(psoc, access->address);
    if (!block || !block->write) {
        return CORTEX_M0_ERROR;
    }
    if (!block->write(psoc, access->address - block->base, access)) {
        psoc_report_unmodelled(psoc, "writes", access->address);
    }
    return CORTEX_M0_OK;
}
