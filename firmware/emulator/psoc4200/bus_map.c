/* Address map of the peripheral blocks. */
#include "emulator/psoc4200/internal.h"

typedef bool register_function(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access);

/* Read the register at `offset` of the serial block SCB0. Returns false if the register does not exist. */
static bool scb0_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_read(psoc, &psoc->scb[0], offset, access);
}

/* Write the register at `offset` of the serial block SCB0. Returns false if the register does not exist. */
static bool scb0_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_write(psoc, &psoc->scb[0], offset, access);
}

/* Read the register at `offset` of the serial block SCB1. Returns false if the register does not exist. */
static bool scb1_read(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_read(psoc, &psoc->scb[1], offset, access);
}

/* Write the register at `offset` of the serial block SCB1. Returns false if the register does not exist. */
static bool scb1_write(struct psoc *psoc, uint32_t offset, struct cortex_m0_access *access)
{
    return psoc_scb_write(psoc, &psoc->scb[1], offset, access);
}

static const struct block {
    uint32_t base, size;
    register_function *read, *write;
} blocks[] = {
    {0x40060000u, 0x10000u, scb0_read, scb0_write}, /* most frequently accessed blocks first */
    {0x40070000u, 0x10000u, scb1_read, scb1_write},
    {0x40080000u, 0x10000u, psoc_csd_read, psoc_csd_write},
    {0x40040000u, 0x10000u, psoc_gpio_read, psoc_gpio_write},
    {0x40010000u, 0x10000u, psoc_hsiom_read, psoc_hsiom_write},
    {0x400B0000u, 0x10000u, psoc_srss_read, psoc_srss_write},
    {0x40020000u, 0x10000u, psoc_clocks_read, psoc_clocks_write},
    {0x40000000u, 0x10000u, psoc_cpuss_read, psoc_cpuss_write},
    {0x0FFFF000u, 0x1000u, psoc_sflash_read, NULL},
};

/* Return the peripheral block at an address of the PSoC 4200, or NULL. */
static const struct block *block_at(uint32_t address)
{
    for (unsigned i = 0; i < sizeof blocks / sizeof blocks[0]; i++) {
        if (address - blocks[i].base < blocks[i].size) {
            return &blocks[i];
        }
    }
    return NULL;
}

/* Read a peripheral register for the processor. A register that the emulator does not model is reported and stops the
 * processor. Returns CORTEX_M0_ERROR (bus fault) for an address without a block. */
enum cortex_m0_bus_status psoc_on_read(void *context, struct cortex_m0_access *access)
{
    struct psoc *psoc = context;
    const struct block *block = block_at(access->address);
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
    const struct block *block = block_at(access->address);
    if (!block || !block->write) {
        return CORTEX_M0_ERROR;
    }
    if (!block->write(psoc, access->address - block->base, access)) {
        psoc_report_unmodelled(psoc, "writes", access->address);
    }
    return CORTEX_M0_OK;
}
