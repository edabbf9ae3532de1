/* A hub that executes a firmware image on an emulated PSoC 4200 (psoc4/). hub_node.c calls these functions if its
 * `psoc` is not NULL.
 *
 * The processor runs continuously: world.c runs it up to the next event of another kind, or until it drives a wire. */
#ifndef EMULATOR_HUB_CORTEX_H
#define EMULATOR_HUB_CORTEX_H

#include "emulator/hub_node.h"

/* Create the emulated chip of the hub, in a world with a hub image. Returns 0, or -1 after an error line on stderr (out
 * of memory). */
int hub_cortex_open(struct hub_node *node, const struct world_description *world);
void hub_cortex_close(struct hub_node *node);

void hub_cortex_set_power(struct hub_node *node, bool on, vtime now, uint8_t reset_cause);

/* Execute up to `until`, also if the processor drives its wires before. */
void hub_cortex_run(struct hub_node *node, vtime until);

/* Report to the hub's I2C master that the bus has completed its command. */
void hub_cortex_on_bus_event(struct hub_node *node, vtime now);
void hub_cortex_stall(struct hub_node *node, vtime until);

/* Inject a fault: the processor takes a HardFault. */
void hub_cortex_take_hard_fault(struct hub_node *node);

#endif
