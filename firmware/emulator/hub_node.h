/* The emulated hub: the real hub firmware, its bus and UART, and a CPU that takes time. */
#ifndef EMULATOR_HUB_NODE_H
#define EMULATOR_HUB_NODE_H

#include "emulator/boot_node.h"
#include "emulator/bus.h"
#include "emulator/psoc4200/psoc.h"
#include "emulator/uart.h"
#include "emulator/vtime.h"
#include "hub/hub.h"

#define HUB_SLOTS 32u
#define HUB_TRANSFER_POOL (2u * TAXEL_HUB_BUFFER_SIZE(TAXEL_SNAPSHOT_SIZE(TAXEL_TAXELS_MAX)))
#define HUB_TRANSMIT_RING 288u

struct hub_node {
    struct boot_node boot;
    struct psoc *psoc; /* NULL: this program's own firmware runs, else an image is executed (hub_cortex.h) */
    bool rts_is_wired;
    enum boot_node_runs runs;
    bool has_confirmed;
    struct taxel_hub hub;
    struct taxel_hub_config config;
    uint8_t firmware_version[3];
    struct taxel_hub_hal hal;
    struct taxel_hub_slot slots[HUB_SLOTS];
    uint8_t transfer_pool[HUB_TRANSFER_POOL];
    uint8_t transmit_ring[HUB_TRANSMIT_RING];
    struct bus *bus;
    struct uart *uart;
    double clock_rate;
    double clock_start_us;
    vtime booted;
    vtime now; /* while firmware runs: the time it sees */
    vtime cpu_free;
    vtime wake; /* when the main loop next has something to do */
    vtime power_back_at; /* after a planned cut */
    bool restart_wanted;
    bool powered;
};

/* Returns 0, or -1 without memory. */
int hub_node_init(struct hub_node *node, struct bus *bus, struct uart *uart, const struct world_description *world);
void hub_node_free(struct hub_node *node);
void hub_node_boot(struct hub_node *node, vtime now, uint8_t reset_cause);
void hub_node_unplug(struct hub_node *node, vtime now);

/* The CPU is busy with something else until then. */
void hub_node_stall(struct hub_node *node, vtime until);

/* Interrupts, at the time they are raised. */
void hub_node_i2c_done(struct hub_node *node, vtime now);
void hub_node_uart_received(struct hub_node *node, vtime now);
void hub_node_uart_sent(struct hub_node *node, vtime now, size_t bytes);

/* When its main loop next has something to do, and one pass of it; an executed hub runs on to `horizon`, or until it acts. */
vtime hub_node_next(const struct hub_node *node);
void hub_node_run(struct hub_node *node, vtime horizon);

#endif
