/* One emulated sensor board: the real sensor firmware, a front end, a clock of its own, and a CPU that takes time.
 *
 * A board runs lazily: nothing happens in it until somebody needs its state at a time, and then board_advance() runs all its
 * interrupts up to that time. That is exact, because boards meet only on the bus. */
#ifndef EMULATOR_BOARD_NODE_H
#define EMULATOR_BOARD_NODE_H

#include <stdbool.h>

#include "emulator/boot_node.h"
#include "emulator/board_fields.h"
#include "emulator/electronics.h"
#include "emulator/fault_log.h"
#include "emulator/front_end.h"
#include "emulator/psoc4200/psoc.h"
#include "emulator/skin/skin.h"
#include "emulator/stimulus.h"
#include "emulator/vtime.h"
#include "emulator/world_file.h"
#include "sensor/sensor.h"

struct board_node {
    struct taxel_sensor sensor;
    struct taxel_sensor_config config;
    struct taxel_sensor_hal hal;
    const struct board_description *description;
    const struct effects *effects;
    size_t index; /* of this board in the world */
    struct board_fields fields;
    const struct droop_loads *loads;
    struct electronics *electronics; /* NULL: the ideal ones */
    struct silent_contact contact;
    struct clock_wander wander;
    double wander_rate; /* of the clock during this scan */
    struct front_end front_end;
    struct normals normals;
    uint8_t taxel_at[TAXEL_LINES_MAX][TAXEL_LINES_MAX];
    uint8_t snapshots[3][TAXEL_SNAPSHOT_SIZE(TAXEL_TAXELS_MAX)];
    taxel_compact_state compact_states[TAXEL_COMPACT_TAXELS_MAX];
    uint8_t compact_residuals[TAXEL_COMPACT_TAXELS_MAX];
    uint8_t compact_buffers[2][TAXEL_COMPACT_BUFFER_SIZE(TAXEL_COMPACT_TAXELS_MAX)];
    double clock_rate;
    double cycle; /* of its CPU, in units of vtime */
    vtime tick_period, tick_length; /* SysTick's */
    vtime now; /* while firmware runs: the time it sees */
    struct boot_node *boot;
    struct psoc *psoc; /* NULL: this program's own firmware runs, else an image is executed (board_cortex.h) */
    enum boot_node_runs runs;
    uint8_t address;   /* that it answers at now */
    bool has_confirmed; /* its image, or found that it was */
    vtime watchdog_at;
    vtime boot_end;   /* from then on it answers */
    vtime clock_zero; /* its own clock began then, a little earlier */
    vtime tick;       /* the last one of SysTick that was asked about */
    vtime flash_until; /* a row is being written: nothing is acknowledged */
    vtime cpu_free;
    vtime compact_end; /* when the main loop is through with what it does for compact snapshots */
    vtime conversion_end;
    vtime interrupt;  /* when the interrupt that starts the next conversion began */
    uint16_t crossing; /* of the conversion under way */
    unsigned unsent;  /* bytes that the slave's FIFO still has */
    uint16_t conversion_taxel;
    uint8_t conversion_tx, conversion_rx;
    bool begins_scan; /* the conversion under way is a scan's first */
    vtime powered_at; /* cold */
    vtime power_back_at; /* after a planned cut */
    bool powered;
    bool restart_wanted;
    uint64_t conversions;

    /* faults */
    struct fault_log *log; /* NULL: nobody wants to know */
    vtime stretch;       /* of the next address byte */
    unsigned hold_clocks; /* SDA is held low until the master has given that many clocks */
    vtime scl_held_until;
    unsigned corrupt_bytes;
    unsigned nacks;
};

int board_node_init(struct board_node *board, const struct board_description *description,
                    const struct world_description *world, const struct stimulus *stimulus, const struct skin *skin,
                    size_t index, size_t first_taxel, const struct droop_loads *loads);
void board_node_free(struct board_node *board);
void board_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause);
void board_advance(struct board_node *board, vtime until);

/* When a planned power cut (flash.h) or its end is due next, and what is due by then. */
vtime board_power_event(const struct board_node *board);
void board_power_events(struct board_node *board, vtime until);

/* What the bus asks of a board, at the end of the byte in question. Each returns when the board lets go of the clock. */
vtime board_address(struct board_node *board, vtime now, bool reading, bool *acknowledge);
vtime board_write(struct board_node *board, vtime now, uint8_t byte, bool *acknowledge);
vtime board_read(struct board_node *board, vtime now, uint8_t *byte);
void board_stop(struct board_node *board, vtime now);
void board_bus_error(struct board_node *board, vtime now);
bool board_answers(struct board_node *board, vtime now, uint8_t address);

#endif
