/* One emulated sensor board: the sensor firmware, compiled natively, with a front end, a clock and a CPU whose
 * interrupts take time.
 *
 * A board is advanced lazily: board_advance() runs all its interrupts up to the time at which the state of the board is
 * needed. The result does not depend on when it is called, because boards affect each other on the bus only. */
#ifndef EMULATOR_BOARD_NODE_H
#define EMULATOR_BOARD_NODE_H

#include <stdbool.h>

#include "emulator/board_fields.h"
#include "emulator/boot_node.h"
#include "emulator/effects/droop.h"
#include "emulator/electronics.h"
#include "emulator/original/original_board.h"
#include "emulator/base/fault_log.h"
#include "emulator/physics/front_end.h"
#include "emulator/psoc4/psoc.h"
#include "emulator/skin/skin.h"
#include "emulator/skin/stimulus.h"
#include "emulator/base/vtime.h"
#include "emulator/world_file/world_file.h"
#include "sensor/sensor.h"

struct board_node {
    struct taxel_sensor sensor;
    struct taxel_sensor_config config;
    struct taxel_sensor_hal hal;
    const struct board_description *description;
    const struct effects *effects;
    size_t board_index; /* in the world */
    struct board_fields fields;
    const struct droop_loads *loads;
    struct electronics *electronics; /* NULL: ideal electronics */
    struct silent_contact contact;
    struct clock_drift clock_drift;
    double clock_drift_rate; /* factor on the clock rate during this scan */
    struct front_end front_end;
    struct normal_source normals;
    uint8_t taxel_at[TAXEL_LINES_MAX][TAXEL_LINES_MAX]; /* [tx][rx] */
    uint8_t tx_of_taxel[TAXEL_TAXELS_MAX], rx_of_taxel[TAXEL_TAXELS_MAX];
    uint8_t snapshots[3][TAXEL_SNAPSHOT_SIZE(TAXEL_TAXELS_MAX)];
    taxel_compact_state compact_states[TAXEL_COMPACT_TAXELS_MAX];
    uint8_t compact_residuals[TAXEL_COMPACT_TAXELS_MAX];
    uint8_t compact_buffers[2][TAXEL_COMPACT_BUFFER_SIZE(TAXEL_COMPACT_TAXELS_MAX)];
    double clock_rate;              /* relative to the nominal frequency */
    double cycle;                   /* duration of a CPU cycle, in units of vtime */
    vtime tick_period, tick_length; /* of the SysTick interrupt */
    vtime now;                      /* the time that the firmware sees while it runs */
    struct boot_node *boot;
    struct psoc *psoc; /* NULL: natively compiled firmware; otherwise an image is executed (board_cortex.h) */
    struct original_board *original; /* not NULL: the board behaves as an original board (board_original.h) */
    enum running_program program;
    uint8_t address;    /* present I2C address */
    bool has_confirmed; /* the running image has been confirmed */
    vtime watchdog_at;  /* when the watchdog resets the board; VTIME_NEVER: the program feeds it */
    vtime stalled_at;   /* when the program finds that no conversion ends; VTIME_NEVER: the board scans */
    uint8_t fault_record[TAXEL_FAULT_RECORD_SIZE]; /* survives every reset, but no loss of power */
    vtime boot_end;                                /* the application acknowledges its address from then on */
    vtime clock_origin;                            /* zero of the board's own clock, shortly before boot_end */
    vtime last_tick;                               /* cached time of the latest SysTick interrupt */
    vtime flash_busy_until;                        /* the board acknowledges nothing while a row is written */
    vtime cpu_free;                                /* end of the interrupt that occupies the CPU */
    vtime compact_end; /* end of the main loop's work on compact snapshots; VTIME_NEVER: none */
    vtime conversion_end;
    vtime interrupt_begin; /* of the interrupt that starts the next conversion */
    uint16_t crossing;     /* of the running conversion */
    unsigned fifo_fill;    /* bytes left in the slave's transmit FIFO */
    uint16_t conversion_taxel;
    uint8_t conversion_tx, conversion_rx;
    bool is_first_of_scan;   /* the running conversion is the first of a scan */
    vtime power_on_time;     /* of the latest power-on, not of other resets */
    vtime power_return_time; /* after a planned power cut */
    bool is_powered;
    bool restart_requested;
    uint64_t conversions;

    /* faults */
    struct fault_log *log;    /* NULL: faults are not logged */
    vtime address_stretch;    /* clock stretching of the next address byte */
    unsigned sda_hold_clocks; /* SCL clocks for which the board still holds SDA low */
    vtime scl_held_until;
    unsigned corrupt_bytes_left;
    unsigned nacks_left;
};

/* Return 0, or -1 after an error line on stderr. `first_taxel`: of the board whose skin is measured, in the
 * stimulus. */
int board_node_init(struct board_node *board, const struct board_description *description,
                    const struct world_description *world, const struct stimulus *stimulus, const struct skin *skin,
                    size_t board_index, size_t first_taxel, const struct droop_loads *loads);
void board_node_free(struct board_node *board);

/* Switch the power on (which resets the board) or off. */
void board_set_power(struct board_node *board, bool on, vtime now, uint8_t reset_cause);

/* Inject a fault of a natively compiled program or of an executed image, at the time to which the board was advanced:
 * lose the interrupt of the conversion in progress; or let the processor take a HardFault (native: with these
 * registers). */
void board_lose_conversion(struct board_node *board, vtime now);
void board_take_hard_fault(struct board_node *board, vtime now, uint32_t program_counter, uint32_t link_register);

/* Run everything that happens in the board up to `until`. */
void board_advance(struct board_node *board, vtime until);

/* Return the time of the next planned power cut (flash.h) or of its end; VTIME_NEVER if there is none. */
vtime board_next_power_event(const struct board_node *board);

/* Execute all planned power cuts, and their ends, that are due by `until`. */
void board_run_power_events(struct board_node *board, vtime until);

/* Report an I2C event to the board, at the end of the byte that causes it. A returned time is when the board releases
 * SCL. */
vtime board_on_address(struct board_node *board, vtime now, uint8_t address, bool reading, bool *acknowledge);
vtime board_on_write(struct board_node *board, vtime now, uint8_t byte, bool *acknowledge);
vtime board_on_read(struct board_node *board, vtime now, uint8_t *byte);
void board_on_stop(struct board_node *board, vtime now);
void board_on_bus_error(struct board_node *board, vtime now);

/* Return whether the board is ready and responds to this address: board_on_address() may be called. */
bool board_can_respond(struct board_node *board, vtime now, uint8_t address);

#endif
