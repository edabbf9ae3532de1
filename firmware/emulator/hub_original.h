/* A hub that behaves as the original hub (original/), in place of the project's own firmware. hub_node.c calls these
 * functions if its `original` is not NULL. */
#ifndef EMULATOR_HUB_ORIGINAL_H
#define EMULATOR_HUB_ORIGINAL_H

#include <stdio.h>

#include "emulator/hub_node.h"

/* Create the original firmware of the hub, in a world with `protocol original`. Returns 0, or -1 after an error line on
 * stderr (out of memory). */
int hub_original_open(struct hub_node *node, const struct world_description *world);
void hub_original_close(struct hub_node *node);

void hub_original_boot(struct hub_node *node, vtime now);
void hub_original_on_i2c_done(struct hub_node *node, vtime now);
vtime hub_original_next_time(const struct hub_node *node);
void hub_original_run(struct hub_node *node, vtime now);

/* Write the account of the cycles as the member `original` of a JSON object, followed by a comma. */
void hub_original_write_statistics(const struct hub_node *node, FILE *file);

#endif
