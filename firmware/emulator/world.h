/* The emulated world: one hub, its boards, the bus, the UART, a host, and the stimulus of the skin. The world is
 * advanced from event to event: the earliest event first, simultaneous events in a fixed order, so that a seed
 * determines every byte. */
#ifndef EMULATOR_WORLD_H
#define EMULATOR_WORLD_H

#include "emulator/board_node.h"
#include "emulator/bus.h"
#include "emulator/endpoint.h"
#include "emulator/base/fault_log.h"
#include "emulator/host_script.h"
#include "emulator/hub_node.h"
#include "emulator/skin/stimulus.h"
#include "emulator/base/thread_pool.h"
#include "emulator/uart.h"
#include "emulator/world_file/world_file.h"

/* The second master of the bus: the I2C adapter of a test rig. */
struct bus_adapter {
    bool is_done;
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
    struct thread_pool *thread_pool; /* NULL: boards and skin are computed in the caller's thread */
    struct bus bus;
    struct bus_adapter adapter;
    struct uart uart;
    struct hub_node hub;
    size_t next_fault;
    struct fault_log log;
    bool has_power_cuts; /* power cuts are planned */
    vtime now;
    vtime boards_advanced_until; /* every board has been advanced at least to this time */
    uint64_t events;
};

/* Return the number of taxels of all boards. */
size_t world_taxel_count(const struct world_description *description);

/* Create the world. The arguments must outlive it. Returns 0, or -1 after an error line on stderr; call world_free() in
 * both cases. */
int world_init(struct world *world, const struct world_description *description, struct stimulus *stimulus,
               struct endpoint *endpoint, struct host_script *script);

/* Compute boards and skin in the threads of `thread_pool` from now on; the pool must outlive the world. */
void world_use_thread_pool(struct world *world, struct thread_pool *thread_pool);

void world_free(struct world *world);

/* Run every event up to and including `until`. Returns 0, or -1 after an error line on stderr if the stimulus is
 * invalid. */
int world_run(struct world *world, vtime until);

/* Read the bytes that the host has sent, and complete records of a live stimulus. Returns 0, or -1 after an error line
 * on stderr if the stimulus is invalid. */
int world_poll_inputs(struct world *world);

/* Set the values that act on the skin from now on, in a world without a stimulus stream. Returns 0, or -1 after an
 * error line on stderr if a value is invalid. */
int world_set_stimulus(struct world *world, const float *values);

/* Inject a fault at once (`time_s` is ignored). Returns 0, or -1 if too many faults are pending, or for a fault of a
 * branch that does not exist or has no such line. */
int world_inject_fault(struct world *world, const struct fault_description *fault);

/* Plan a power cut during a flash write of a board, or of the hub (board NULL). Returns 0, or -1 if too many cuts are
 * planned. */
int world_plan_power_cut(struct world *world, struct board_node *board, const struct flash_cut_plan *plan);

/* Write a JSON file with the counters of the run. Returns 0, or -1 after an error line on stderr. */
int world_write_statistics(const struct world *world, const char *path, double wall_seconds);

#endif
