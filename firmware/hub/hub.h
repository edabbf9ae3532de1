/* The hub: the I2C master of all sensor boards. It reads one snapshot after the other, checks its CRC, and forwards it
 * unparsed as a UART frame; it executes the host's commands between two polls.
 *
 *   hub.c       set-up and one pass of the main loop      outbox.c    outgoing UART frames: ring, counters
 *   schedule.c  selects the next transfer                 inbox.c     incoming UART bytes: ring, frame search
 *   outcome.c   evaluates a finished transfer             command.c   handshake and commands
 *   identify.c  identity and scan settings of a board     report.c    status frames
 *   recovery.c  nine clocks that free a stuck bus         pool.c      buffers of the transfers
 *   launch.c    starts a transfer                         snapshot.c  checks a snapshot and forwards it
 *   stall.c     a UART without a reader
 *
 * Integration (`hal`: struct taxel_hub_hal of the port; all memory is the caller's):
 *
 *     static struct taxel_hub hub;
 *     static struct taxel_hub_slot slots[17];
 *     static uint8_t pool[2u * TAXEL_HUB_BUFFER_SIZE(TAXEL_COMPACT_SIZE_MAX)], ring[512];
 *     static const struct taxel_hub_config config = {
 *         .hal = &hal, .firmware_version = version, .unique_id = unique_id, .scl_hz = 400000u,
 *         .slots = slots, .slot_capacity = 17u, .transfer_pool = pool, .transfer_pool_size = sizeof pool,
 *         .transmit_ring = ring, .transmit_ring_size = sizeof ring,
 *     };
 *     taxel_hub_init(&hub, &config, TAXEL_RESET_CAUSE_POWER_ON);
 *     for (;;) {
 *         taxel_hub_run(&hub);    // after every interrupt, and at the time requested with hal.wake_at()
 *         wait_for_interrupt();
 *     }
 *     // I2C interrupt, end of a transfer:   taxel_hub_on_i2c_done(&hub, TAXEL_I2C_OK);
 *     // UART interrupt, byte received:      taxel_hub_on_uart_byte(&hub, byte);
 *     // UART interrupt, space to transmit:  count = taxel_hub_uart_pull(&hub, bytes, sizeof bytes);
 *
 * firmware/tests/test_integration_examples.c compiles and runs this example. */
#ifndef TAXEL_HUB_H
#define TAXEL_HUB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"
#include "hal/hub_hal.h"

#define TAXEL_HUB_COMMAND_PAYLOAD_MAX 68u
#define TAXEL_HUB_RECEIVE_RING 256u
/* free bytes at which RTS stops the host: an adapter still sends its transmitter's bytes */
#define TAXEL_HUB_HOLD_SPACE 32u
#define TAXEL_HUB_RELEASE_SPACE 128u /* free bytes at which RTS lets the host continue */
#define TAXEL_HUB_REPLY_RESERVE 180u /* bytes: the longest reply, and small frames that cannot wait */

/* A transfer's buffer becomes the frame of the bytes that were read into it: the headroom takes the frame's header and
 * stuffing, the tailroom its CRC and delimiter. */
#define TAXEL_HUB_HEADROOM 18u /* the length byte of a compact snapshot is read into its last byte */
#define TAXEL_HUB_TAILROOM 6u
#define TAXEL_HUB_BUFFER_SIZE(read_max) (TAXEL_HUB_HEADROOM + (read_max) + TAXEL_HUB_TAILROOM)

/* State of one board. Ordered without padding, because a hub has many slots and little RAM. */
struct taxel_hub_slot {
    uint8_t address;
    uint8_t taxel_count;
    uint8_t last_fault;
    uint8_t polls;           /* modulo 256; taxel_hub_polls() restores the upper bits */
    uint8_t state : 2;       /* enum taxel_board_state */
    uint8_t attempts : 2;    /* failed polls in this cycle, or rejected identities in a row */
    bool retry_pending : 1;  /* a second poll is due in this cycle */
    bool info_requested : 1; /* the identity is to be read and forwarded as BOARD_INFO */
    /* the board's register pointer is at the polled register: a read needs no write before it */
    bool pointer_is_snapshot : 1;
    bool has_sequence : 1;        /* last_sequence is valid */
    bool has_clock : 1;           /* last_timestamp_us is valid */
    bool has_compact : 1;         /* the board has compact snapshots */
    bool acknowledge_pending : 1; /* `key_frame_id` is to be written to the board */
    bool forget_pending : 1;      /* the host has no key frame of the board, which is to be written to the board */
    bool has_settings : 1;        /* the host set `settings`: they are written again after a restart of the board */
    bool settings_dirty : 1;      /* `settings` are to be written to the board */
    bool settings_rejected : 1;   /* the settings read back differ from those written */
    uint8_t front_end;            /* converter for which `settings` are, as the host stated */
    uint16_t consecutive_failures;
    uint16_t last_sequence;
    uint16_t key_frame_id;      /* of the key frame that the host has decoded */
    uint32_t last_timestamp_us; /* board's clock in the last forwarded snapshot */
    uint32_t last_read_us;      /* hub's clock when that snapshot, or an incompatible identity, was read */
    uint32_t forwarded, repeated, nacks, timeouts, crc_errors, bus_errors, dropped, retries;
    struct taxel_scan_settings settings;
};

struct taxel_hub_config {
    /* Functions of the port. Every pointer is set, except those that hub_hal.h permits to be NULL. */
    const struct taxel_hub_hal *hal;

    /* Major, minor, patch: 3 bytes, each 0 to 255. Sent in HUB_HANDSHAKE. */
    const uint8_t *firmware_version;

    /* Id of the processor: 8 bytes of any value. Sent in HUB_HANDSHAKE. */
    const uint8_t *unique_id;

    /* Fault record of the last fault of the hub since power-on: TAXEL_FAULT_RECORD_SIZE (12) bytes as in the protocol.
     * NULL: the hub keeps none, and the reply to GET_FAULT has no data. */
    const uint8_t *fault_record;

    /* Clock rate of the bus in Hz; greater than 0, typically 100000 to 1000000. Determines the time limits of
     * transfers and the instant of a board's clock in TIME_SYNC. */
    uint32_t scl_hz;

    /* One slot per board: slot_capacity elements, 1 to 112 (the number of usable I2C addresses). Boards without a
     * free slot are not polled. */
    struct taxel_hub_slot *slots;
    uint8_t slot_capacity;

    /* Buffers in which bytes are read, framed, and kept until the UART has sent them. Size in bytes, at most 65535:
     * at least twice TAXEL_HUB_BUFFER_SIZE() of the larger of (a) the largest board's snapshot, uncompressed and
     * compact, and (b) TAXEL_BOARD_INFO_SIZE + 4. A board whose snapshot does not fit is reported as TOO_LARGE. */
    uint8_t *transfer_pool;
    size_t transfer_pool_size;

    /* Ring for all other outgoing frames. Size in bytes, at most 65535: greater than TAXEL_HUB_REPLY_RESERVE plus
     * taxel_encoded_size_max(TAXEL_HUB_STATUS_SIZE). */
    uint8_t *transmit_ring;
    size_t transmit_ring_size;
};

/* Purpose of an I2C transfer. */
enum taxel_job_kind {
    TAXEL_JOB_NONE = 0,
    TAXEL_JOB_POLL,           /* reads a snapshot */
    TAXEL_JOB_PROBE_SLOT,     /* sends the address of a known board that is absent */
    TAXEL_JOB_IDENTIFY,       /* reads the identity register */
    TAXEL_JOB_READ_SETTINGS,  /* after an identity, into the same buffer behind the identity */
    TAXEL_JOB_CHECK_SETTINGS, /* after settings were written */
    TAXEL_JOB_WRITE_SETTINGS,
    TAXEL_JOB_ACKNOWLEDGE,   /* writes the host's answer to a key frame */
    TAXEL_JOB_CLOCK,         /* reads the board's clock, for TIME_SYNC */
    TAXEL_JOB_PROBE_ADDRESS, /* sends an address, to find unknown boards */
    TAXEL_JOB_PASS_THROUGH,  /* the transfer of the command I2C_TRANSFER */
};

/* The transfer in progress, or the last one. */
struct taxel_job {
    uint8_t kind; /* enum taxel_job_kind */
    uint8_t slot;
    uint8_t address;
    bool is_compact;      /* a poll that reads a length byte first */
    uint16_t pool_offset; /* of its buffer */
    uint16_t cycle;       /* in which it was started */
    uint16_t read_size;
    uint32_t started_us;
    uint32_t deadline_us;
    uint8_t write_size;
    uint8_t write_bytes[1u + TAXEL_COMPACT_ACKNOWLEDGE_SIZE]; /* of all jobs but WRITE_SETTINGS and PASS_THROUGH */
};

/* Bytes that were read correctly and are not framed yet. */
struct taxel_unframed {
    uint16_t size; /* 0: none */
    uint16_t cycle;
    uint32_t started_us;
    uint16_t pool_offset;
    uint8_t slot;
    uint8_t type : 7; /* of the future frame */
    bool is_checked : 1;
};

enum taxel_cycle_stage {
    TAXEL_STAGE_POLLS = 0, /* every known board once */
    TAXEL_STAGE_CLOCK,     /* one board's clock */
    TAXEL_STAGE_PROBES,    /* a few addresses without a known board */
    TAXEL_STAGE_WAIT,      /* until the period of the cycle has elapsed */
};

struct taxel_cycle {
    uint8_t stage;           /* enum taxel_cycle_stage */
    uint8_t position;        /* slot of the next board to poll */
    uint8_t clock_slot;      /* slot whose clock was read last */
    uint8_t probes_left;     /* in this cycle */
    uint8_t probe_address;   /* probed last */
    bool has_launched;       /* a transfer was started in this cycle */
    uint16_t number;         /* of this cycle, sent with each snapshot; modulo 65536 */
    uint32_t count;          /* of cycles since the start of the hub */
    uint32_t last_length_us; /* duration of the last cycle */
    uint32_t period_us;      /* shortest time between two starts; 0: as fast as possible */
    uint32_t last_upkeep_us; /* start of the last clock reading and probes */
    uint64_t started_us;
};

/* A probe of every address, for SCAN_BUS or because the hub is not streaming. */
struct taxel_bus_scan {
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
    uint8_t transfer_size; /* bytes to write; they stay in the inbox's payload */
    uint8_t transfer_read;
};

struct taxel_report {
    bool active;
    bool for_command;
    uint8_t next; /* 0: the hub itself; n: slot n - 1 */
    uint32_t next_us;
};

/* with more frames, the free parts of a pool for 17 boards are too small for the largest board */
#define TAXEL_HUB_LARGE_MAX 3u

/* A frame in the pool that is to be sent. */
struct taxel_large {
    uint16_t end;  /* offset in the pool */
    uint16_t mark; /* position at which the ring waits while this frame is sent */
    /* bytes to send; set by the main loop, then counted down by the UART's interrupt alone */
    volatile uint16_t remaining;
};

struct taxel_outbox {
    volatile uint16_t head; /* position of the ring's next frame: written by the main loop only */
    volatile uint16_t tail; /* next byte for the UART: written by its interrupt only */
    struct taxel_large large[TAXEL_HUB_LARGE_MAX];
    volatile uint8_t large_first; /* index of the next frame to send: written by the interrupt only */
    uint8_t large_next;           /* index of the next frame to add: written by the main loop only */
    volatile bool is_held;        /* the interrupt must not take any byte */
    uint16_t sequence;
    uint32_t frames_sent, bytes_sent, frames_dropped;
};

struct taxel_inbox {
    volatile uint8_t head, tail;
    uint8_t search_position;  /* no delimiter between the tail and this position */
    volatile bool is_holding; /* RTS stops the host */
    volatile uint16_t overruns;
    uint16_t overruns_reported;
    uint32_t commands, commands_rejected;
    uint8_t ring[TAXEL_HUB_RECEIVE_RING];
    uint8_t payload[TAXEL_HUB_COMMAND_PAYLOAD_MAX]; /* of the command in progress */
};

struct taxel_hub {
    const struct taxel_hub_config *config;
    struct taxel_job job;
    volatile bool job_done;
    volatile int8_t job_result; /* enum taxel_i2c_result */
    struct taxel_cycle cycle;
    struct taxel_bus_scan bus_scan;
    struct taxel_command_in_progress command;
    struct taxel_report report;
    struct taxel_outbox outbox;
    struct taxel_inbox inbox;
    struct taxel_unframed unframed;
    uint32_t restart_by_us;
    uint32_t bus_down_until_us;
    uint32_t host_bus_until_us; /* until then the idle bus is reserved for transfers of the host */
    uint32_t bus_recoveries;
    uint32_t uart_bytes_taken; /* bytes that the UART had taken at the last check */
    uint32_t uart_progress_us; /* last check at which the UART had taken more bytes than before */
    uint8_t bus_fault;         /* enum taxel_board_fault that the last bus recovery did not remove */
    uint8_t slot_count;
    uint8_t version;            /* of the protocol, as negotiated; 0 before a handshake */
    uint8_t reset_cause;        /* enum taxel_reset_cause */
    uint8_t settings_read_slot; /* slot whose settings are read next, or 0xFF */
    uint8_t settings_read_kind; /* TAXEL_JOB_READ_SETTINGS or TAXEL_JOB_CHECK_SETTINGS */
    bool uart_is_stalled;       /* the UART has no reader: frames without space are dropped */
    bool streaming;
    bool has_retry;             /* retry_pending is set in at least one slot */
    bool use_compact;           /* the host requested compact snapshots from the boards that have them */
    bool discard_requested : 1; /* the UART stalled: the queued frames must be discarded */
    bool restart_requested : 1;
    bool bootloader_requested : 1;
};

/* A program with a single hub defines TAXEL_HUB_FIXED_CONFIG and this constant, so that the compiler can use the
 * values of the configuration. */
#ifdef TAXEL_HUB_FIXED_CONFIG
extern const struct taxel_hub_config taxel_hub_fixed_config;
#endif

/* Return the number of polls of a board. Every poll but the one in progress is in exactly one outcome counter, so the
 * slot stores only the low bits of the number. */
uint32_t taxel_hub_polls(const struct taxel_hub_slot *slot);

/* Initialise the hub and queue a HUB_HANDSHAKE frame. `config` must stay valid. */
void taxel_hub_init(struct taxel_hub *hub, const struct taxel_hub_config *config, uint8_t reset_cause);
/* Run one pass of the main loop. */
void taxel_hub_run(struct taxel_hub *hub);

/* To be called from the interrupts: a transfer has ended (`result`: enum taxel_i2c_result), or a byte was received. */
void taxel_hub_on_i2c_done(struct taxel_hub *hub, int8_t result);
void taxel_hub_on_uart_byte(struct taxel_hub *hub, uint8_t byte);
/* Copy up to `size` bytes that are to be sent to `bytes`; returns their number, 0 if none are queued. */
size_t taxel_hub_uart_pull(struct taxel_hub *hub, uint8_t *bytes, size_t size);

/* Return the number of bytes queued for the UART. */
size_t taxel_hub_uart_pending(const struct taxel_hub *hub);

#endif
