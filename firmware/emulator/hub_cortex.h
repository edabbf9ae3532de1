/* A hub whose image is executed (psoc4200/): hub_node.c hands over to here. Its processor is always at work, so that world.c runs it up
 * to the next event of another kind, or until it acts on a wire. */
#ifndef EMULATOR_HUB_CORTEX_H
#define EMULATOR_HUB_CORTEX_H

#include "emulator/hub_node.h"

/* For a world that has a hub image. Returns 0, or -1 without memory. */
int hub_cortex_open(struct hub_node *node, const struct world_description *world);
void hub_cortex_close(struct hub_node *node);

void hub_cortex_power(struct hub_node *node, bool on, vtime now, uint8_t reset_cause);
void hub_cortex_run(struct hub_node *node, vtime until);
/* The bus has done what the hub's master wanted. */
void hub_cortex_bus_event(struct hub_node *node, vtime now);
void hub_cortex_stall(struct hub_node *node, vtime until);

#endif
