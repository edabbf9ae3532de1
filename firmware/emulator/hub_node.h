/* The emulated hub: the hub firmware, compiled natively, with its bus, its UART and a CPU whose work takes time. A hub
 * with an image executes the image instead (hub_cortex.h). */
#ifndef EMULATOR_HUB_NODE_H
#define EMULATOR_HUB_NODE_H

#include "emulator/boot_node.h"
#include "emulator/bus.h"
#include "emulator/original/original_hub.h"
#include "emulator/psoc4/psoc.h"
#include "emulator/uart.h"
#include "emulator/base/vtime.h"
#include "hub/hub.h"

#define HUB_SLOTS 32u
#define HUB_TRANSFER_POOL (2u * TAXEL_HUB_BUFFER_SIZE(TAXEL_SNAPSHOT_SIZE(TAXEL_TAXELS_MAX)))
#define HUB_TRANSMIT_RING 288u

struct hub_node {
    struct boot_node boot;
    struct psoc *psoc;             /* NULL: natively compiled firmware; otherwise an image is executed (hub_cortex.h) */
    struct original_hub *original; /* not NULL: the hub behaves as the original hub (hub_original.h) */
    bool rts_is_wired;
    enum running_program program;
    bool has_confirmed; /* the running image has been confirmed */
    struct taxel_hub hub;
    struct taxel_hub_config config;
    uint8_t firmware_version[3];
    uint8_t fault_record[TAXEL_FAULT_RECORD_SIZE]; /* survives every reset, but no loss of power */
    struct taxel_hub_hal hal;
    struct taxel_hub_slot slots[HUB_SLOTS];
    uint8_t transfer_pool[HUB_TRANSFER_POOL];
    uint8_t transmit_ring[HUB_TRANSMIT_RING];
    struct bus *bus;
    struct uart *uart;
    double clock_rate;
    double clock_start_us;
    vtime booted;
    vtime now;               /* the time that the firmware sees while it runs */
    vtime cpu_free;          /* end of the work that occupies the CPU */
    vtime wake;              /* when the main loop next has work */
    vtime power_return_time; /* after a planned power cut */
    bool restart_requested;
    bool is_powered;
};

/* Create the hub of the world, without power. Returns 0, or -1 after an error line on stderr (out of memory). */
int hub_node_init(struct hub_node *node, struct bus *bus, struct uart *uart, const struct world_description *world);
void hub_node_free(struct hub_node *node);

/* Perform a power-up or reset. reset_cause: reset cause of the protocol. */
void hub_node_boot(struct hub_node *node, vtime now, uint8_t reset_cause);

/* Switch the power off. */
void hub_node_unplug(struct hub_node *node, vtime now);

/* Return whether the hub sends its measurements: after a command of the host, or always (original hub). */
bool hub_node_is_streaming(const struct hub_node *node);

/* Inject a fault: other work occupies the CPU until then. */
void hub_node_stall(struct hub_node *node, vtime until);

/* Inject a fault: the processor takes a HardFault. A native hub stores these registers and restarts at once. */
void hub_node_take_hard_fault(struct hub_node *node, vtime now, uint32_t program_counter, uint32_t link_register);

/* Execute an interrupt of the hub, at the time at which it is raised. */
void hub_node_on_i2c_done(struct hub_node *node, vtime now);
void hub_node_on_uart_received(struct hub_node *node, vtime now);
void hub_node_on_uart_sent(struct hub_node *node, vtime now, size_t bytes);

/* Return when the main loop next has work. */
vtime hub_node_next_time(const struct hub_node *node);

/* Run one pass of the main loop at hub_node_next_time(). An executed hub runs up to `horizon`, or until it drives a
 * wire. */
void hub_node_run(struct hub_node *node, vtime horizon);

#endif
