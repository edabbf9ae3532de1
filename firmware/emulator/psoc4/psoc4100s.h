/* Blocks that only a PSoC 4100S has. */
#ifndef PSOC4_PSOC4100S_H
#define PSOC4_PSOC4100S_H

#include "emulator/psoc4/internal.h"

psoc_register_function psoc4100s_peri_read, psoc4100s_peri_write, psoc4100s_csd_read, psoc4100s_csd_write,
    psoc4100s_srss_read, psoc4100s_srss_write;
uint32_t psoc4100s_clock_divider(const struct psoc *psoc, unsigned peripheral);
void psoc4100s_csd_end(struct psoc *psoc);
void psoc4100s_srss_reset(struct psoc *psoc, uint32_t causes);

#endif
