/* The I2C bus in virtual time: 9 clocks a byte, start and stop, clock stretching; several slaves on one address pull the line
 * down together. Byte by byte; single bits only where a fault makes them matter. */
#ifndef EMULATOR_BUS_H
#define EMULATOR_BUS_H

#include "emulator/board_node.h"
#include "hal/hub_hal.h"

enum bus_phase {
    BUS_IDLE,
    BUS_ADDRESS_WRITE,
    BUS_WRITE,
    BUS_ADDRESS_READ,
    BUS_READ,
    BUS_STOP,
    BUS_DONE,
};

struct bus {
    struct board_node *boards;
    size_t board_count;
    vtime clock; /* one SCL period */
    vtime next;  /* when the byte or condition under way ends */
    enum bus_phase phase;
    struct taxel_i2c_transfer transfer;
    size_t index;
    int8_t result;
    struct board_node *slaves[4]; /* that acknowledged the present address */
    size_t slave_count;
    bool scl_high, sda_high; /* what the master drives by hand during recovery */
    uint64_t bytes;
    uint64_t transfers;
    vtime started;
    vtime busy;
    bool may_be_held; /* some board has been told to hold SDA low */
};

void bus_init(struct bus *bus, struct board_node *boards, size_t board_count, double scl_hz);
void bus_start(struct bus *bus, const struct taxel_i2c_transfer *transfer, vtime now);
void bus_abort(struct bus *bus);

/* Run everything that ends before or at `horizon`. Returns true when the transfer has ended (result in bus->result, at
 * bus->next). */
bool bus_run(struct bus *bus, vtime horizon);

void bus_drive(struct bus *bus, bool scl_high, bool sda_high);
bool bus_sda(const struct bus *bus);

#endif
