/* Blocks that only a PSoC 4200 has. */
#ifndef PSOC4_PSOC4200_H
#define PSOC4_PSOC4200_H

#include "emulator/psoc4/internal.h"

psoc_register_function psoc4200_clocks_read, psoc4200_clocks_write, psoc4200_csd_read, psoc4200_csd_write,
    psoc4200_srss_read, psoc4200_srss_write;
uint32_t psoc4200_clock_divider(const struct psoc *psoc, unsigned peripheral);
void psoc4200_csd_end(struct psoc *psoc);
void psoc4200_srss_reset(struct psoc *psoc, uint32_t causes);

#endif
