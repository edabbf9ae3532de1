/* Functions shared by bus.c and bus_bytewise.c. */
#ifndef EMULATOR_BUS_INTERNAL_H
#define EMULATOR_BUS_INTERNAL_H

#include "emulator/bus.h"

#define BUS_CLOCKS_PER_BYTE 9u /* eight bits and the acknowledge */

/* Return whether a board holds SDA low. */
static inline bool bus_sda_is_held(const struct bus *bus)
{
    if (bus_wiring_is_low(&bus->wiring, WIRING_SDA)) {
        return true;
    }
    if (!bus->lines_may_be_held) {
        return false; /* the usual case; this function is called for every byte */
    }
    for (size_t i = 0; i < bus->board_count; i++) {
        if (bus->boards[i].is_powered && bus->boards[i].sda_hold_clocks) {
            return true;
        }
    }
    return false;
}

/* Return until when a board holds SCL low; 0: none does; VTIME_NEVER: a short of the wiring holds SCL low. */
static inline vtime bus_scl_held_until(const struct bus *bus)
{
    vtime until = bus_wiring_is_low(&bus->wiring, WIRING_SCL) ? VTIME_NEVER : 0;
    for (size_t i = 0; bus->lines_may_be_held && i < bus->board_count; i++) {
        if (bus->boards[i].is_powered) {
            until = vtime_max(until, bus->boards[i].scl_held_until);
        }
    }
    return until;
}

/* Return the time `wait` after `time`; a line that stays low postpones an event for ever. */
static inline vtime bus_add_time(vtime time, vtime wait)
{
    return time == VTIME_NEVER ? VTIME_NEVER : time + wait;
}

/* bus.c */

void bus_begin_transfer(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now);

/* Begin the next byte or the stop condition as soon as the slaves (at `released`) and the master have released SCL. */
void bus_begin_byte(struct bus *bus, enum bus_phase phase, vtime released);
void bus_begin_stop(struct bus *bus, vtime released);

/* End a transfer in which slaves transmit while the master writes or stops, because a damaged address byte has
 * addressed them for reading: the master reads a level that it does not drive and gives up, and each slave remains in
 * the middle of its byte. */
void bus_handle_collision(struct bus *bus, int8_t result);

/* bus_bytewise.c */

/* Begin a transfer with its address byte. The start condition waits until the lines are free. */
void bus_bytewise_begin(struct bus *bus, uint8_t address_byte, vtime now);

/* Return the event that reports the end of the transfer. */
enum bus_event bus_bytewise_result(const struct bus *bus);

#endif
