/* What bus.c and bus_steps.c share. */
#ifndef EMULATOR_BUS_PARTS_H
#define EMULATOR_BUS_PARTS_H

#include "emulator/bus.h"

#define BUS_CLOCKS_PER_BYTE 9u /* eight bits and the acknowledge */

static inline bool bus_sda_is_held(const struct bus *bus)
{
    if (!bus->may_be_held) {
        return false; /* the common case, asked for every byte */
    }
    for (size_t i = 0; i < bus->board_count; i++) {
        if (bus->boards[i].powered && bus->boards[i].hold_clocks) {
            return true;
        }
    }
    return false;
}

/* Until when some board holds SCL low; 0: none does. */
static inline vtime bus_scl_held_until(const struct bus *bus)
{
    vtime until = 0;
    for (size_t i = 0; bus->may_be_held && i < bus->board_count; i++) {
        if (bus->boards[i].powered) {
            until = vtime_max(until, bus->boards[i].scl_held_until);
        }
    }
    return until;
}

/* bus.c */
void bus_begin(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now);
void bus_next_byte(struct bus *bus, enum bus_phase phase, vtime released);
void bus_send_stop(struct bus *bus, vtime released);
/* Slaves that were called for reading, by a damaged address byte, send against a master that writes or stops: the master
 * sees a line that it has let go, and a slave is left in the middle of its byte. */
void bus_collide(struct bus *bus, int8_t result);

/* bus_steps.c */
/* The address byte. A start condition waits until the lines are free. */
void bus_steps_begin(struct bus *bus, uint8_t address_byte, vtime now);
enum bus_event bus_steps_end(const struct bus *bus);

#endif
