/* The emulated world: 1 hub, its boards, bus, UART, a host, and what acts on the skin, moved on by the earliest event. */
#ifndef EMULATOR_WORLD_H
#define EMULATOR_WORLD_H

#include "emulator/board_node.h"
#include "emulator/bus.h"
#include "emulator/thread_pool.h"
#include "emulator/endpoint.h"
#include "emulator/fault_log.h"
#include "emulator/host_script.h"
#include "emulator/hub_node.h"
#include "emulator/stimulus.h"
#include "emulator/uart.h"
#include "emulator/world_file.h"

/* Another master on the same bus: a bench's I2C adapter. */
struct bus_adapter {
    bool done;
    int8_t result;
};

struct world {
    const struct world_description *description;
    struct stimulus *stimulus;
    struct endpoint *endpoint;
    struct host_script *script;
    struct board_node boards[WORLD_BOARDS_MAX];
    size_t board_count;
    struct droop_loads loads;
    struct skin skin;
    struct thread_pool *thread_pool; /* who works on boards and skin; NULL: the caller alone */
    struct bus bus;
    struct bus_adapter adapter;
    struct uart uart;
    struct hub_node hub;
    size_t next_fault;
    struct fault_log log;
    bool has_power_cuts; /* some are planned */
    vtime now;
    vtime shared; /* boards have come that far at least */
    uint64_t events;
};

size_t world_taxels(const struct world_description *description);
int world_init(struct world *world, const struct world_description *description, struct stimulus *stimulus,
               struct endpoint *endpoint, struct host_script *script);

/* Advance boards and skin in the threads of `thread_pool` from now on; the pool must outlive the world. */
void world_use_thread_pool(struct world *world, struct thread_pool *thread_pool);

void world_free(struct world *world);

/* Run every event up to and including `until`. Returns 0, or -1 if the stimulus was bad. */
int world_run(struct world *world, vtime until);

/* Take up what host and live stimulus have sent meanwhile. Returns 0 or -1 as above. */
int world_poll(struct world *world);

/* Without a stimulus stream: what acts on the skin from now on. Returns 0 or -1 as above. */
int world_press(struct world *world, const float *values);

/* Let something go wrong at once (`time_s` is not looked at). Returns -1 if too much waits to go wrong already. */
int world_inject(struct world *world, const struct fault_description *fault);

/* Cut the power in a write to the flash of a board, or of the hub (NULL). Returns -1 if too many cuts wait already. */
int world_plan_power_cut(struct world *world, struct board_node *board, const struct flash_cut_plan *plan);
int world_write_statistics(const struct world *world, const char *path, double wall_seconds);

#endif
