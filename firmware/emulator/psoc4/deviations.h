/* Differences between a real part and the assumptions of the firmware that no public source settles ("(confirm)" in
 * boards/psoc4200). 0 everywhere: a part as assumed. */
#ifndef PSOC4_DEVIATIONS_H
#define PSOC4_DEVIATIONS_H

#include <stdbool.h>
#include <stdint.h>

struct psoc_deviations {
    /* Interrupt numbers; 0: as assumed. */
    uint8_t irq_scb0, irq_scb1, irq_csd;
    /* Numbers of the peripheral clocks; 0: as assumed. */
    uint8_t clock_scb1, clock_csd_sense, clock_csd_sample;
    bool keeps_no_ram;       /* a reset clears the RAM */
    bool writes_no_flash;    /* a ROM call that writes a row has no effect */
    bool has_no_ilo;         /* the watchdog never resets */
    bool tolerates_no_clock; /* a conversion without a clock never starts, instead of stopping the processor */
};

#endif
