/* Tables of the parts and their pins, from pins.toml of boards/psoc4200 and boards/psoc4100s, and from
 * boards/psoc4200/original (checked by tests). */
#include "emulator/psoc4/parts.h"

#include <stddef.h>
#include <string.h>

#define KIB 1024u

const struct psoc_part psoc_parts[] = {
    {.name = "standard",
     .family = &psoc_4200,
     .flash_size = 32u * KIB,
     .tx_lines = 13,
     .rx_lines = 12,
     .tx = {0x20, 0x21, 0x22, 0x23, 0x24, 0x25, 0x26, 0x27, 0x30, 0x31, 0x34, 0x35, 0x36},
     .rx = {0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x10, 0x11, 0x12, 0x13},
     .bus_port = 4,
     .has_rts = true,
     .rts = 0x06},
    {.name = "psoc4100s",
     .family = &psoc_4100s,
     .flash_size = 64u * KIB,
     .tx_lines = 13,
     .rx_lines = 12,
     .tx = {0x10, 0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x20, 0x21, 0x22, 0x23, 0x24},
     .rx = {0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x34, 0x35, 0x36, 0x37},
     .has_two_capacitors = true,
     .capacitors = {0x42, 0x43},
     .bus_port = 4,
     .has_rts = true,
     .rts = 0x06},
    {.name = "original-palm",
     .family = &psoc_4200,
     .flash_size = 16u * KIB,
     .tx_lines = 1,
     .rx_lines = 20,
     .tx = {0x21},
     .rx = {0x27, 0x26, 0x25, 0x24, 0x23, 0x22, 0x20, 0x17, 0x16, 0x15,
            0x14, 0x13, 0x12, 0x11, 0x10, 0x07, 0x06, 0x05, 0x04, 0x03},
     .rx_per_row = 10,
     .has_two_capacitors = true,
     .capacitors = {0x36, 0x37},
     .bus_port = 4},
    {.name = "original-back_of_hand",
     .family = &psoc_4200,
     .flash_size = 16u * KIB,
     .tx_lines = 1,
     .rx_lines = 25,
     .tx = {0x16},
     .rx = {0x13, 0x12, 0x05, 0x04, 0x14, 0x11, 0x06, 0x03, 0x15, 0x10, 0x07, 0x02, 0x17,
            0x25, 0x26, 0x31, 0x20, 0x24, 0x27, 0x34, 0x21, 0x23, 0x30, 0x35, 0x22},
     .rx_per_row = 13,
     .has_two_capacitors = true,
     .capacitors = {0x36, 0x37},
     .bus_port = 4},
    {.name = "original-finger_tip",
     .family = &psoc_4200,
     .flash_size = 16u * KIB,
     .tx_lines = 1,
     .rx_lines = 14,
     .tx = {0x22},
     .rx = {0x06, 0x07, 0x15, 0x16, 0x20, 0x21, 0x23, 0x05, 0x04, 0x03, 0x02, 0x30, 0x25, 0x24},
     .rx_per_row = 14,
     .has_two_capacitors = true,
     .capacitors = {0x14, 0x13},
     .bus_port = 4},
    {.name = "original-finger_big",
     .family = &psoc_4200,
     .flash_size = 16u * KIB,
     .tx_lines = 1,
     .rx_lines = 15,
     .tx = {0x20},
     .rx = {0x23, 0x22, 0x21, 0x16, 0x15, 0x24, 0x25, 0x26, 0x13, 0x14, 0x27, 0x30, 0x10, 0x11, 0x12},
     .rx_per_row = 15,
     .has_two_capacitors = true,
     .capacitors = {0x05, 0x06},
     .bus_port = 4},
    {.name = "original-finger_small",
     .family = &psoc_4200,
     .flash_size = 16u * KIB,
     .tx_lines = 1,
     .rx_lines = 6,
     .tx = {0x22},
     .rx = {0x24, 0x23, 0x21, 0x25, 0x17, 0x20},
     .rx_per_row = 6,
     .has_two_capacitors = true,
     .capacitors = {0x10, 0x11},
     .bus_port = 4},
    {.name = "original-hub", .family = &psoc_4200, .flash_size = 16u * KIB, .bus_scb = 1, .bus_port = 3},
    {.name = NULL},
};

/* Return the part with this name (kind of chip and its wiring); NULL if the table of parts does not contain it. */
const struct psoc_part *psoc_part_find(const char *name)
{
    for (const struct psoc_part *part = psoc_parts; part->name; part++) {
        if (strcmp(part->name, name) == 0) {
            return part;
        }
    }
    return NULL;
}
