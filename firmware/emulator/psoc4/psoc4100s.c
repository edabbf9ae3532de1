/* Address map and numbers of a PSoC 4100S. */
#include "emulator/psoc4/psoc4100s.h"

#define DIE 0x178u
#define IMO_TCTRIM 0x1CCu
#define IMO_TRIM 0x1E5u
#define TRIMS 25u

/* Look up the byte of the supervisory flash at an offset: unique id, and trims of the oscillator, which are arbitrary
 * constants, because the model does not use them. Returns false if the content is not modelled. */
static bool sflash_byte(const struct psoc *psoc, uint32_t offset, uint8_t *value)
{
    if (offset - DIE < 8u) {
        *value = psoc->config.unique_id[offset - DIE];
    } else if (offset - IMO_TCTRIM < TRIMS || offset - IMO_TRIM < TRIMS) {
        *value = 0x40u;
    } else {
        return false;
    }
    return true;
}

static const struct psoc_block blocks[] = {
    {0x40080000u, 0x10000u, psoc_scb0_read, psoc_scb0_write},
    {0x40090000u, 0x10000u, psoc_scb1_read, psoc_scb1_write},
    {0x400C0000u, 0x1000u, psoc4100s_csd_read, psoc4100s_csd_write},
    {0x40040000u, 0x10000u, psoc_gpio_read, psoc_gpio_write},
    {0x40020000u, 0x10000u, psoc_hsiom_read, psoc_hsiom_write},
    {0x40030000u, 0x10000u, psoc4100s_srss_read, psoc4100s_srss_write},
    {0x40010000u, 0x10000u, psoc4100s_peri_read, psoc4100s_peri_write},
    {0x40100000u, 0x1000u, psoc_cpuss_read, psoc_cpuss_write},
    {0x0FFFF000u, 0x400u, psoc_sflash_read, NULL},
};

const struct psoc_family psoc_4100s = {
    .ram_size = 8192u,
    .timing = cortex_m0_psoc4100s,
    .hz_after_reset = 6e6, /* a quarter of the main oscillator */
    .irq_scb = {7u, 8u},
    .irq_csd = 13u,
    .clock_scb = {0u, 1u},
    .hsiom_stride = 0x100u,
    .blocks = blocks,
    .block_count = sizeof blocks / sizeof blocks[0],
    .configures_flash_clock = true,
    .sflash_byte = sflash_byte,
    .clock_divider = psoc4100s_clock_divider,
    .reset_srss = psoc4100s_srss_reset,
    .end_conversion = psoc4100s_csd_end,
};
