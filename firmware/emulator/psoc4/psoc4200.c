/* Address map and numbers of a PSoC 4200. */
#include "emulator/psoc4/psoc4200.h"

#define CSD_TRIM1 0x162u
#define CSD_TRIM2 0x163u
#define DIE 0x178u
#define IMO_ABS4 0x1CCu
#define IMO_TMPCO4 0x1CDu
#define IMO_TRIM 0x1D0u
#define IMO_TRIMS 46u

/* Look up the byte of the supervisory flash at an offset: unique id, and trims of oscillator and CSD. The trims are
 * arbitrary constants, because the model does not use them. Returns false if the content is not modelled. */
static bool sflash_byte(const struct psoc *psoc, uint32_t offset, uint8_t *value)
{
    if (offset - DIE < 8u) {
        *value = psoc->config.unique_id[offset - DIE];
    } else if (offset - IMO_TRIM < IMO_TRIMS) {
        *value = (uint8_t)(0x60u + offset - IMO_TRIM);
    } else if (offset == CSD_TRIM1 || offset == CSD_TRIM2) {
        *value = 0x88u;
    } else if (offset == IMO_ABS4 || offset == IMO_TMPCO4) {
        *value = 0x20u;
    } else {
        return false;
    }
    return true;
}

static const struct psoc_block blocks[] = {
    {0x40060000u, 0x10000u, psoc_scb0_read, psoc_scb0_write},
    {0x40070000u, 0x10000u, psoc_scb1_read, psoc_scb1_write},
    {0x40080000u, 0x10000u, psoc4200_csd_read, psoc4200_csd_write},
    {0x40040000u, 0x10000u, psoc_gpio_read, psoc_gpio_write},
    {0x40010000u, 0x10000u, psoc_hsiom_read, psoc_hsiom_write},
    {0x400B0000u, 0x10000u, psoc4200_srss_read, psoc4200_srss_write},
    {0x40020000u, 0x10000u, psoc4200_clocks_read, psoc4200_clocks_write},
    {0x40000000u, 0x10000u, psoc_cpuss_read, psoc_cpuss_write},
    {0x0FFFF000u, 0x1000u, psoc_sflash_read, NULL},
};

const struct psoc_family psoc_4200 = {
    .ram_size = 4096u,
    .timing = cortex_m0_psoc4200,
    .hz_after_reset = 24e6,
    .irq_scb = {10u, 11u},
    .irq_csd = 15u,
    .clock_scb = {2u, 3u},
    .hsiom_stride = 4u,
    .blocks = blocks,
    .block_count = sizeof blocks / sizeof blocks[0],
    .sflash_byte = sflash_byte,
    .clock_divider = psoc4200_clock_divider,
    .reset_srss = psoc4200_srss_reset,
    .end_conversion = psoc4200_csd_end,
};
