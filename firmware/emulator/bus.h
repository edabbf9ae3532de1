/* The I2C bus in virtual time: 9 clocks per byte, start and stop conditions, clock stretching. Several slaves with one
 * address drive the lines together (wired AND). The bus works byte by byte; single bits matter only for faults.
 *
 * There are two masters: the hub, and an I2C adapter of the test rig. Each waits until the other has sent its stop
 * condition. The adapter and a native hub submit whole transfers; an executed hub (hub_cortex.h) commands single bytes,
 * between which it holds SCL low. */
#ifndef EMULATOR_BUS_H
#define EMULATOR_BUS_H

#include "emulator/board_node.h"
#include "emulator/bus_faults.h"
#include "emulator/bus_wiring.h"
#include "hal/hub_hal.h"

#define BUS_SLAVES_MAX 32u

enum bus_phase {
    BUS_IDLE,
    BUS_ADDRESS_WRITE,
    BUS_WRITE,
    BUS_ADDRESS_READ,
    BUS_READ,
    BUS_STOP,
    BUS_DONE,
    BUS_HELD, /* by a bytewise master that has not given its next command */
};

/* The result of a command of a bytewise master. */
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
    vtime scl_period;
    vtime byte_hold; /* how long a native hub holds SCL low after each byte, in its interrupt */
    vtime next;      /* end of the present byte or condition */
    enum bus_phase phase;
    struct taxel_i2c_transfer transfer;
    size_t index;         /* of the next byte to write or read */
    unsigned byte_number; /* bytes of this transfer that have ended, address bytes included */
    int8_t result;
    struct board_node *slaves[BUS_SLAVES_MAX]; /* that acknowledged the address */
    size_t slave_count;
    /* the slaves were addressed for reading; differs from the master only after a damaged address byte */
    bool slaves_transmit;
    bool slaves_released; /* the slaves have seen a byte without acknowledge and send no more */
    enum bus_master master;
    bool is_waiting[BUS_MASTERS]; /* for the stop condition of the other master */
    struct taxel_i2c_transfer waiting_transfer[BUS_MASTERS];
    bool is_bytewise;        /* the present master commands single bytes */
    bool hub_waits_bytewise; /* the waiting hub commands single bytes */
    enum bus_event event;
    uint8_t byte;                 /* of the command, or the byte read */
    uint8_t waiting_address_byte; /* of the waiting hub */
    bool master_reads;
    struct bus_faults faults;
    struct bus_wiring wiring;
    struct fault_log *log;
    bool scl_high, sda_high; /* levels that the master drives during bus recovery */
    uint64_t byte_count;
    vtime transfer_begin;
    vtime busy_time;
    bool lines_may_be_held; /* by a board with an injected fault */
};

void bus_init(struct bus *bus, struct board_node *boards, size_t board_count, double scl_hz, struct fault_log *log);

/* Start a transfer of a master at `now`, or as soon as the other master has ended its own. */
void bus_start_transfer(struct bus *bus, enum bus_master master, const struct taxel_i2c_transfer *transfer, vtime now);
void bus_abort(struct bus *bus, enum bus_master master, vtime now);

/* Run everything that ends at `horizon` or before. Returns true when a transfer of bus->master (or one command of a
 * bytewise master) has ended, at bus->next, with the result in bus->result (bus->event). */
bool bus_run(struct bus *bus, vtime horizon);

/* Release the bus after a whole transfer, and begin the transfer for which the other master is waiting. */
void bus_release(struct bus *bus, vtime now);

/* Give a command of a bytewise master: start or repeated start with an address byte; a byte to write; a byte to read;
 * stop. For each command, bus_run() returns true once. */
void bus_bytewise_start(struct bus *bus, uint8_t address_byte, vtime now);
void bus_bytewise_write(struct bus *bus, uint8_t byte, vtime now);
void bus_bytewise_read(struct bus *bus, vtime now);
void bus_bytewise_stop(struct bus *bus, vtime now);

/* Drive the lines, or read their levels, as the hub does in a bus recovery. */
void bus_drive_lines(struct bus *bus, bool scl_high, bool sda_high);
bool bus_is_scl_high(const struct bus *bus, vtime now);
bool bus_is_sda_high(const struct bus *bus);

#endif
