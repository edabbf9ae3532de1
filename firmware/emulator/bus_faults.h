/* Faults that wait for a byte of a transfer: the address byte is number 0, then every byte on the wire, the second address
 * of a write that turns into a read among them. */
#ifndef EMULATOR_BUS_FAULTS_H
#define EMULATOR_BUS_FAULTS_H

#include "emulator/fault_log.h"

#define BUS_FAULTS_MAX 64u

struct bus_faults {
    size_t count;
    struct {
        enum fault_kind kind;
        uint8_t address; /* 0: any */
        unsigned position;
        double value;
    } waiting[BUS_FAULTS_MAX];
};

/* What strikes one byte. */
struct byte_damage {
    bool nack, arbitration, bus_error, brown_out;
    uint8_t flip;   /* bits of the byte */
    vtime stretch;
    vtime off_time; /* of a brown-out */
};

/* The byte is the fault's `value`; `second` is a bit (0 to 7), microseconds of stretching or milliseconds without power.
 * Returns false when too many wait already. */
bool bus_faults_add(struct bus_faults *faults, const struct fault_description *fault);

/* What strikes byte `position` of a transfer with `address`; it is noted in the log and does not wait any longer. */
struct byte_damage bus_faults_take(struct bus_faults *faults, uint8_t address, unsigned position, vtime now,
                                   struct fault_log *log);

#endif
