/* Parts and wirings that the emulated chip can have. "standard" is the board or hub of this project with a PSoC 4200,
 * "psoc4100s" with a PSoC 4100S; the others are the devices of the original hardware (boards/psoc4200/original), whose pins
 * differ for each kind of board. */
#ifndef PSOC4_PARTS_H
#define PSOC4_PARTS_H

#include <stdbool.h>
#include <stdint.h>

#include "emulator/psoc4/family.h"

#define PSOC_PART_LINES_MAX 25u
#define PSOC_PART_STANDARD (&psoc_parts[0])

/* A pin is a byte: port in the high half, number in the low half. */
struct psoc_part {
    const char *name; /* in the world file; NULL ends the table */
    const struct psoc_family *family;
    uint32_t flash_size; /* bytes; a multiple of a row */
    uint8_t tx_lines, rx_lines;
    uint8_t tx[PSOC_PART_LINES_MAX], rx[PSOC_PART_LINES_MAX];
    /* 0: an RX line is a column of the board. Otherwise the board has one TX line, and each group of this number of RX
     * lines is a row. */
    uint8_t rx_per_row;
    bool has_two_capacitors; /* CintA and CintB, without which a conversion counts nothing */
    uint8_t capacitors[2];
    uint8_t bus_scb; /* serial block of the I2C bus, 0 or 1; the UART is on the other block */
    uint8_t bus_port;
    bool has_rts;
    uint8_t rts;
};

extern const struct psoc_part psoc_parts[];

/* Return the part with this name, or NULL. */
const struct psoc_part *psoc_part_find(const char *name);

#endif
