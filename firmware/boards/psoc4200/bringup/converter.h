/* Conversions of a known capacitor with both variants of the circuit, and the numbers of the clocks that they need. */
#ifndef PSOC4200_BRINGUP_CONVERTER_H
#define PSOC4200_BRINGUP_CONVERTER_H

#include <stdbool.h>
#include <stdint.h>

#define CONVERTER_PERIOD \
    4000u /* 100 sub-conversions of 40 sample clocks of 12 MHz: the settings of the original boards */
#define CONVERTER_NONE UINT32_MAX

/* Run one conversion with the current code `code`. `two_capacitors`: integration on CintA and CintB, otherwise on CMOD.
 * Returns the number of sample clocks in which the current source was on, or CONVERTER_NONE if the conversion did not
 * end. `cycles` receives its duration in processor cycles if it ended. */
uint32_t converter_run(bool two_capacitors, uint8_t code, uint32_t *cycles);

void converter_init(void);

/* Try all numbers of a peripheral clock in turn, the assumed one first, and keep the first with which the conversion
 * ends (sample clock) or counts (sense clock). Returns the number, or CONVERTER_NONE. */
uint32_t converter_find_sample_clock(void);
uint32_t converter_find_sense_clock(bool two_capacitors);

#endif
