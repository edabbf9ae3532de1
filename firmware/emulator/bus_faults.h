/* I2C faults that take effect at one byte of a transfer. Byte 0 is the address byte; all further bytes on the wire
 * count, including the second address byte of a write that continues as a read. */
#ifndef EMULATOR_BUS_FAULTS_H
#define EMULATOR_BUS_FAULTS_H

#include "emulator/base/fault_log.h"

#define BUS_FAULTS_MAX 64u

struct bus_faults {
    size_t count;
    struct {
        enum fault_kind kind;
        uint8_t address; /* 0: every address */
        unsigned position;
        double value;
    } pending[BUS_FAULTS_MAX];
};

/* The sum of the faults at one byte. */
struct byte_damage {
    bool nack, arbitration, bus_error, brown_out;
    uint8_t flip;   /* inverted bits of the byte */
    vtime stretch;  /* additional time with SCL low */
    vtime off_time; /* length of the brown-out */
};

/* Schedule a fault of a later transfer. The fault's `value` is the position of the byte; its `second_value` is a bit (0
 * to 7), microseconds of clock stretching or milliseconds without power. Returns false if BUS_FAULTS_MAX faults are
 * pending. */
bool bus_faults_add(struct bus_faults *faults, const struct fault_description *fault);

/* Remove the pending faults of byte `position` of a transfer with `address`, log them and return their sum. */
struct byte_damage bus_faults_apply(struct bus_faults *faults, uint8_t address, unsigned position, vtime now,
                                    struct fault_log *log);

#endif
