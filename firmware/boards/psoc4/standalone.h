/* Image without slots and without this project's bootloader, for the 16 KiB of the original boards: it is written by a
 * programmer, or lies behind the original bootloader. It has no trial, no confirmation and no configuration rows;
 * standalone.c contains the board's configuration instead. */
#ifndef PSOC4_STANDALONE_H
#define PSOC4_STANDALONE_H

#include <stdint.h>

#include "board_pins.h"
#include "generated/taxel_bootloader.h"

/* Format of a configuration record (protocol/taxel_protocol/bootloader.py), with one current code per RX line.
 * tools/firmware/original_image.py writes the address of a physical board here. */
#ifdef BOARD_RX_LINES
#define STANDALONE_CODES (BOARD_RX_LINES > 16u ? BOARD_RX_LINES : 16u)
extern const uint8_t standalone_configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_IDAC_CODES + STANDALONE_CODES];
#endif

#endif
