/* The I2C bus in virtual time: 9 clocks a byte, start and stop, clock stretching; several slaves on one address pull the line
 * down together. Byte by byte; single bits only where a fault makes them matter.
 *
 * Two masters may stand on it: the hub, and an adapter on the bench. Either waits until the other has made its stop. The adapter and
 * a native hub give whole transfers, an executed hub (hub_cortex.h) commands a byte at a time, between which it holds SCL low. */
#ifndef EMULATOR_BUS_H
#define EMULATOR_BUS_H

#include "emulator/board_node.h"
#include "emulator/bus_faults.h"
#include "hal/hub_hal.h"

enum bus_phase {
    BUS_IDLE,
    BUS_ADDRESS_WRITE,
    BUS_WRITE,
    BUS_ADDRESS_READ,
    BUS_READ,
    BUS_STOP,
    BUS_DONE,
    BUS_HELD, /* by a master that will give its next command */
};

/* What has become of a master's last command. */
enum bus_event {
    BUS_ACKNOWLEDGED,
    BUS_NOT_ACKNOWLEDGED,
    BUS_BYTE,
    BUS_STOPPED,
    BUS_ARBITRATION_LOST,
    BUS_ERROR,
};

enum bus_master {
    BUS_HUB,
    BUS_ADAPTER,
    BUS_MASTERS,
};

struct bus {
    struct board_node *boards;
    size_t board_count;
    vtime clock; /* one SCL period */
    vtime hold;  /* how long a native hub's master keeps SCL low after each byte: its interrupt */
    vtime next;  /* when the byte or condition under way ends */
    enum bus_phase phase;
    struct taxel_i2c_transfer transfer;
    size_t index;
    unsigned wire_byte; /* bytes of this transfer that have ended */
    int8_t result;
    struct board_node *slaves[32]; /* that acknowledged the present address */
    size_t slave_count;
    bool slaves_send; /* they were called for reading: unless the address byte was damaged, so does the master */
    bool let_go;      /* they have seen a byte that was not acknowledged, and send no more */
    enum bus_master master;
    bool waits[BUS_MASTERS]; /* for the other master's stop */
    struct taxel_i2c_transfer waiting[BUS_MASTERS];
    bool by_steps;         /* the master gives commands */
    bool waiting_by_steps; /* so will the hub, when its turn comes */
    enum bus_event event;
    uint8_t byte;          /* of the command, or what it has brought */
    uint8_t byte_waiting;  /* the hub's address byte */
    bool master_reads;
    struct bus_faults faults;
    struct fault_log *log;
    bool scl_high, sda_high; /* what the master drives by hand during recovery */
    uint64_t bytes;
    uint64_t transfers;
    vtime started;
    vtime busy;
    bool may_be_held; /* some board has been told to hold a line low */
};

void bus_init(struct bus *bus, struct board_node *boards, size_t board_count, double scl_hz, struct fault_log *log);

/* The transfer begins now, or when the other master has ended its own. */
void bus_start(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now);
void bus_abort(struct bus *bus, enum bus_master master, vtime now);

/* Run everything that ends before or at `horizon`. Returns true when a transfer has ended: of bus->master, result in
 * bus->result, at bus->next. Then the bus is free from that time on: bus_hand_over() begins what the other master waits for. */
bool bus_run(struct bus *bus, vtime horizon);
void bus_hand_over(struct bus *bus, vtime now);

/* Commands of a hub's master; for each, bus_run() returns true once, at bus->next, with bus->event. Start (again) and address byte;
 * a byte, to be written or to be read; stop. */
void bus_step_start(struct bus *bus, uint8_t address_byte, vtime now);
void bus_step_write(struct bus *bus, uint8_t byte, vtime now);
void bus_step_read(struct bus *bus, vtime now);
void bus_step_stop(struct bus *bus, vtime now);

void bus_drive(struct bus *bus, bool scl_high, bool sda_high);
bool bus_scl(const struct bus *bus, vtime now);
bool bus_sda(const struct bus *bus);

#endif
