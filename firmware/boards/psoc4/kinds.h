/* The board designs (kinds) that a sensor image supports. tools/firmware/board_header.py writes kinds.c from hand
 * descriptions. */
#ifndef PSOC4_KINDS_H
#define PSOC4_KINDS_H

#include <stdint.h>

#include "generated/taxel_protocol.h"

struct kind {
    uint8_t code;
    uint8_t rows;    /* TX lines */
    uint8_t columns; /* RX lines */
    uint8_t taxels;
    uint8_t crossing_map[TAXEL_CROSSING_MAP_SIZE];
};

extern const struct kind kinds[];
extern const uint8_t kind_count;

#endif
