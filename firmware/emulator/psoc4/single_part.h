/* One emulated chip alone, as on the first board that is brought up: its UART leads to the caller, its I2C bus has
 * pull-up resistors and no device, and a known capacitor connects TX line 0 and RX line 0. */
#ifndef PSOC4_SINGLE_PART_H
#define PSOC4_SINGLE_PART_H

#include <stddef.h>
#include <stdint.h>

/* What the part and its board have, and the faults of both. All numbers are doubles, for a caller in another
 * language. */
struct single_part_settings {
    double clock_rate;           /* actual divided by nominal frequency of the main oscillator */
    double capacitance_pf;       /* between the lines; 0: not connected */
    double capacitors;           /* integration capacitors of the board: 1 on P4.2, or 2 on P3.6 and P3.7; 0: none */
    double idac_gain;            /* actual divided by nominal current of the current source */
    double scl_stuck, sda_stuck; /* not 0: the line is connected to ground */
    double rx_open;              /* not 0: the chip receives no byte */
    double no_pull_ups;          /* not 0 */
    /* Deviations of the part (psoc4/deviations.h). */
    double irq_scb0, irq_scb1, irq_csd, clock_scb1, clock_csd_sense, clock_csd_sample;
    double keeps_no_ram, writes_no_flash, has_no_ilo;
};

struct single_part;

/* Create a chip with an image in its flash and power it on. Returns NULL if out of memory. */
struct single_part *single_part_new(const uint8_t *image, size_t size, const struct single_part_settings *settings);
void single_part_free(struct single_part *part);

/* Run for a duration of virtual time. */
void single_part_run(struct single_part *part, double seconds);

/* Send bytes to the UART of the chip at 115,200 baud. Returns the number of bytes for which the buffer had space. */
size_t single_part_put(struct single_part *part, const uint8_t *bytes, size_t count);
/* Take bytes that a host at 115,200 baud has received. Returns their number. A byte that the chip sent at another rate
 * is received wrongly. */
size_t single_part_take(struct single_part *part, uint8_t *bytes, size_t size);
/* Return the frequency (Hz) of the clock pin P1.7, from its edges since the last call; 0 with fewer than three
 * edges. */
double single_part_measure_clock_pin(struct single_part *part);

#endif
