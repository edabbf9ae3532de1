/* The hub: reads one snapshot after the other from the boards on its I2C bus and streams them, unread but for their CRC, as
 * UART frames; obeys the host's commands between two polls.
 *
 *   hub.c       set-up and the main loop's pass           outbox.c    UART frames out: ring, back-pressure, counting
 *   schedule.c  which transfer comes next                 inbox.c     UART bytes in: the ring, and frames in it
 *   outcome.c   what a finished transfer means            command.c   handshake and commands
 *   identify.c  who a board is, and its scan settings     report.c    status frames
 *   recovery.c  nine clocks for a stuck bus               pool.c      where transfers read to
 *   launch.c    how a transfer begins                     snapshot.c  is it whole, is it news: on to the host
 *   stall.c     a UART that nobody reads
 *
 * The port calls taxel_hub_on_...() from interrupts and taxel_hub_run() from its main loop after every interrupt, and at
 * the time that hal->wake_at() asked for. All memory is the caller's. */
#ifndef TAXEL_HUB_H
#define TAXEL_HUB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"
#include "hal/hub_hal.h"

#define TAXEL_HUB_COMMAND_PAYLOAD_MAX 68u
#define TAXEL_HUB_RECEIVE_RING 256u
#define TAXEL_HUB_HOLD_ROOM 32u    /* free bytes at which the host is asked to hold back: what adapters still send after that */
#define TAXEL_HUB_RELEASE_ROOM 128u /* and at which it may go on */
#define TAXEL_HUB_REPLY_RESERVE 180u /* the longest reply, and small frames that cannot wait */

/* The place of a transfer becomes the frame of what was read into it: its header goes before, its CRC behind. */
#define TAXEL_HUB_HEADROOM 18u /* its last byte is where the length of a compact snapshot is read to */
#define TAXEL_HUB_TAILROOM 6u
#define TAXEL_HUB_BUFFER_SIZE(read_max) (TAXEL_HUB_HEADROOM + (read_max) + TAXEL_HUB_TAILROOM)

/* There are many of them and little memory: no gaps. */
struct taxel_hub_slot {
    uint8_t address;
    uint8_t taxel_count;
    uint8_t last_fault;
    uint8_t polls;      /* modulo 256: taxel_hub_polls() knows the rest */
    uint8_t state : 2;  /* enum taxel_board_state */
    uint8_t attempts : 2;
    bool retry : 1;
    bool info_wanted : 1;
    bool pointer_is_snapshot : 1; /* the board's register pointer, at what is polled: a read needs no write before it */
    bool has_sequence : 1;
    bool has_clock : 1; /* last_timestamp_us says something */
    bool has_compact : 1; /* the board has compact snapshots */
    bool acknowledge : 1; /* the board is to be told `reference` */
    bool forget : 1;      /* or that the host has none */
    bool has_settings : 1; /* the host chose settings: they are written again when the board restarts */
    bool settings_dirty : 1;
    bool settings_rejected : 1;
    uint16_t consecutive_failures;
    uint16_t last_sequence;
    uint16_t reference; /* name of the candidate that the host has decoded */
    uint32_t last_timestamp_us; /* board's clock, of the last snapshot forwarded */
    uint32_t last_read_us;      /* hub's clock, when that, or an identity that did not fit, was read */
    uint32_t forwarded, repeated, nacks, timeouts, crc_errors, bus_errors, dropped, retries;
    struct taxel_scan_settings settings;
};

struct taxel_hub_config {
    const struct taxel_hub_hal *hal;
    const uint8_t *firmware_version; /* major, minor, patch */
    const uint8_t *unique_id;        /* 8 bytes */
    uint32_t scl_hz;
    struct taxel_hub_slot *slots;
    uint8_t slot_capacity;
    uint8_t *transfer_pool; /* some of it is filled by the bus while the rest is being framed and sent */
    size_t transfer_pool_size; /* twice TAXEL_HUB_BUFFER_SIZE of the largest board's snapshot, and of TAXEL_BOARD_INFO_SIZE + 4 */
    uint8_t *transmit_ring;       /* all other frames */
    size_t transmit_ring_size;    /* more than TAXEL_HUB_REPLY_RESERVE and a HUB_STATUS frame */
};

enum taxel_job_kind {
    TAXEL_JOB_NONE = 0,
    TAXEL_JOB_POLL,
    TAXEL_JOB_PROBE_SLOT,
    TAXEL_JOB_IDENTIFY,
    TAXEL_JOB_READ_SETTINGS,  /* after an identity, and into its buffer behind it */
    TAXEL_JOB_CHECK_SETTINGS, /* after a write of settings */
    TAXEL_JOB_WRITE_SETTINGS,
    TAXEL_JOB_ACKNOWLEDGE,
    TAXEL_JOB_CLOCK,
    TAXEL_JOB_PROBE_ADDRESS,
    TAXEL_JOB_PASS_THROUGH,
};

struct taxel_job {
    uint8_t kind; /* enum taxel_job_kind */
    uint8_t slot;
    uint8_t address;
    bool is_compact; /* a poll that reads a length first */
    uint16_t at; /* in the pool: its place */
    uint16_t cycle; /* in which it was started */
    uint16_t read_size;
    uint32_t started_us;
    uint32_t deadline_us;
    uint8_t write_size;
    uint8_t write_bytes[1u + TAXEL_COMPACT_ACKNOWLEDGE_SIZE]; /* of all but settings and the host's own */
};

/* What was read well and is not a frame yet. */
struct taxel_unframed {
    uint16_t size; /* 0: nothing */
    uint16_t cycle;
    uint32_t started_us;
    uint16_t at; /* in the pool */
    uint8_t slot;
    uint8_t type : 7; /* of the frame that it becomes */
    bool is_judged : 1;
};

enum taxel_cycle_stage {
    TAXEL_STAGE_POLLS = 0,
    TAXEL_STAGE_CLOCK,
    TAXEL_STAGE_PROBES,
    TAXEL_STAGE_WAIT,
};

struct taxel_cycle {
    uint8_t stage; /* enum taxel_cycle_stage */
    uint8_t position;
    uint8_t clock_slot;
    uint8_t probes_left;
    uint8_t probe_address;
    bool launched; /* a transfer, in this cycle */
    uint16_t number;
    uint32_t count;
    uint32_t last_length_us;
    uint32_t period_us;
    uint32_t upkept_us; /* when a cycle last read a clock and probed */
    uint64_t started_us;
};

struct taxel_sweep {
    bool active;
    bool for_command;
    uint8_t address;
    uint32_t next_us;
};

struct taxel_command_in_progress {
    bool active;
    uint8_t tag;
    uint8_t command; /* enum taxel_command */
    uint8_t address;
    uint8_t transfer_size; /* of what is to be written: it stays in the inbox's payload */
    uint8_t transfer_read;
};

struct taxel_report {
    bool active;
    bool for_command;
    uint8_t next; /* 0: the hub itself; n: slot n - 1 */
    uint32_t next_us;
};

#define TAXEL_HUB_LARGE_MAX 3u /* more places would cut the pool of 17 boards into pieces that are too small for the largest */

/* A frame in the pool, which is to be sent. */
struct taxel_large {
    uint16_t end; /* of it in the pool */
    uint16_t mark; /* where the ring waits while it is sent */
    volatile uint16_t left; /* bytes to send: once they are there, the UART's interrupt alone counts them down */
};

struct taxel_outbox {
    volatile uint16_t head; /* where the ring's next frame goes: moved by the main loop only */
    volatile uint16_t tail; /* next byte for the UART: moved by its interrupt only */
    struct taxel_large large[TAXEL_HUB_LARGE_MAX];
    volatile uint8_t large_first; /* which is sent next: moved by the interrupt only */
    uint8_t large_next; /* the next to come: moved by the main loop only */
    volatile bool is_held; /* the interrupt is to take nothing for a moment */
    uint16_t sequence;
    uint32_t frames_sent, bytes_sent, frames_dropped;
};

struct taxel_inbox {
    volatile uint8_t head, tail;
    uint8_t searched; /* no delimiter from the tail to here */
    volatile bool holds; /* the host has been asked to hold back */
    volatile uint16_t overruns;
    uint16_t overruns_told;
    uint32_t commands, commands_rejected;
    uint8_t ring[TAXEL_HUB_RECEIVE_RING];
    uint8_t payload[TAXEL_HUB_COMMAND_PAYLOAD_MAX]; /* of the command that is worked off */
};

struct taxel_hub {
    const struct taxel_hub_config *config;
    struct taxel_job job;
    volatile bool job_done;
    volatile int8_t job_result; /* enum taxel_i2c_result */
    struct taxel_cycle cycle;
    struct taxel_sweep sweep;
    struct taxel_command_in_progress command;
    struct taxel_report report;
    struct taxel_outbox outbox;
    struct taxel_inbox inbox;
    struct taxel_unframed unframed;
    uint32_t restart_by_us;
    uint32_t bus_down_until_us;
    uint32_t host_until_us; /* transfers of the host have the idle bus to themselves until then */
    uint32_t bus_recoveries;
    uint32_t uart_mark; /* bytes that the UART had taken when that was last asked */
    uint32_t uart_moved_us; /* and when more had been taken than before */
    uint8_t bus_fault; /* enum taxel_board_fault that bus recovery left */
    uint8_t slot_count;
    uint8_t version; /* negotiated; 0 before a handshake */
    uint8_t reset_cause; /* enum taxel_reset_cause */
    uint8_t settings_read_slot; /* whose settings are to be read next, or 0xFF */
    uint8_t settings_read_kind; /* TAXEL_JOB_READ_SETTINGS or TAXEL_JOB_CHECK_SETTINGS */
    bool uart_is_stalled; /* nobody reads: what finds no room is dropped */
    bool streaming;
    bool retry_wanted; /* by one of the boards */
    bool compact; /* the host wants compact snapshots of the boards that have them */
    bool drop_wanted : 1; /* since then: of what was to be sent before */
    bool restart_wanted : 1;
    bool bootloader_wanted : 1;
};

/* Every poll ends in one of the counters, and no more than one is under way: so few bits of their number are kept. */
uint32_t taxel_hub_polls(const struct taxel_hub_slot *slot);

/* Set up from a configuration that stays in place, and announce the start with a HUB_HANDSHAKE frame. */
void taxel_hub_init(struct taxel_hub *hub, const struct taxel_hub_config *config, uint8_t reset_cause);
void taxel_hub_run(struct taxel_hub *hub);

void taxel_hub_on_i2c_done(struct taxel_hub *hub, int8_t result);
void taxel_hub_on_uart_byte(struct taxel_hub *hub, uint8_t byte);
size_t taxel_hub_uart_pull(struct taxel_hub *hub, uint8_t *bytes, size_t size);
size_t taxel_hub_uart_pending(const struct taxel_hub *hub);

#endif
