/* The hub: reads one snapshot after the other from the boards on its I2C bus and streams them, unread but for their CRC, as
 * UART frames; obeys the host's commands between two polls.
 *
 *   hub.c       set-up and the main loop's pass           outbox.c    UART frames out: ring, back-pressure, counting
 *   schedule.c  which transfer comes next                 inbox.c     UART bytes in: hello and commands
 *   outcome.c   what a finished transfer means            report.c    status frames
 *   identify.c  who a board is, and its scan settings     recovery.c  nine clocks for a stuck bus
 *
 * The port calls taxel_hub_on_...() from interrupts and taxel_hub_run() from its main loop after every interrupt, and at
 * the time that hal->wake_at() asked for. All memory is the caller's. */
#ifndef TAXEL_HUB_H
#define TAXEL_HUB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "codec/deframer.h"
#include "generated/taxel_protocol.h"
#include "hal/hub_hal.h"

#define TAXEL_HUB_COMMAND_PAYLOAD_MAX 68u
#define TAXEL_HUB_COMMAND_ENCODED_MAX (2u * 80u)
#define TAXEL_HUB_RECEIVE_RING 256u
#define TAXEL_HUB_HOLD_ROOM 32u    /* free bytes at which the host is asked to hold back: what adapters still send after that */
#define TAXEL_HUB_RELEASE_ROOM 128u /* and at which it may go on */
#define TAXEL_HUB_REPLY_RESERVE 200u

struct taxel_hub_slot {
    uint8_t address;
    uint8_t state; /* enum taxel_board_state */
    uint8_t last_fault;
    uint8_t taxel_count;
    bool pointer_is_snapshot; /* the board's register pointer: a read needs no write before it */
    bool retry;
    bool has_sequence;
    bool has_settings; /* the host chose settings: they are written again when the board restarts */
    bool settings_dirty;
    bool settings_rejected;
    bool info_wanted;
    uint8_t attempts;
    uint16_t consecutive_failures;
    uint16_t last_sequence;
    uint32_t last_timestamp_us; /* board's clock, of the last snapshot forwarded */
    uint32_t last_read_us;      /* hub's clock, when that, or an identity that did not fit, was read */
    uint32_t polls, forwarded, repeated, nacks, timeouts, crc_errors, bus_errors, dropped, retries;
    struct taxel_scan_settings settings;
};

struct taxel_hub_config {
    const struct taxel_hub_hal *hal;
    uint8_t firmware_version[3];
    uint8_t unique_id[8];
    uint8_t reset_cause;
    uint32_t scl_hz;
    struct taxel_hub_slot *slots;
    uint8_t slot_capacity;
    uint8_t *transfer_buffers[2]; /* one is filled by the bus while the other is being framed */
    size_t transfer_buffer_size;  /* at least the largest board's snapshot, and TAXEL_IDENTITY_SIZE */
    uint8_t *transmit_ring;
    size_t transmit_ring_size; /* more than one taxel frame of the largest board and TAXEL_HUB_REPLY_RESERVE */
};

enum taxel_job_kind {
    TAXEL_JOB_NONE = 0,
    TAXEL_JOB_POLL,
    TAXEL_JOB_PROBE_SLOT,
    TAXEL_JOB_IDENTIFY,
    TAXEL_JOB_READ_SETTINGS,  /* after an identity: the other transfer buffer holds it */
    TAXEL_JOB_CHECK_SETTINGS, /* after a write of settings */
    TAXEL_JOB_WRITE_SETTINGS,
    TAXEL_JOB_CLOCK,
    TAXEL_JOB_PROBE_ADDRESS,
    TAXEL_JOB_PASS_THROUGH,
};

struct taxel_job {
    uint8_t kind; /* enum taxel_job_kind */
    uint8_t slot;
    uint8_t address;
    uint8_t buffer; /* which transfer buffer it reads into */
    uint16_t cycle; /* in which it was started */
    uint8_t write_size;
    uint8_t write_bytes[1u + TAXEL_SETTINGS_REGISTER_SIZE];
    size_t read_size;
    uint64_t started_us;
    uint64_t deadline_us;
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
    uint64_t started_us;
};

struct taxel_sweep {
    bool active;
    bool for_command;
    uint8_t address;
    uint8_t found[16]; /* one bit an address */
    uint64_t next_us;
};

struct taxel_command_in_progress {
    bool active;
    uint8_t tag;
    uint8_t command; /* enum taxel_command */
    uint8_t address;
    uint8_t transfer_size;
    uint8_t transfer_read;
    uint8_t transfer_bytes[TAXEL_TRANSFER_MAX];
};

struct taxel_report {
    bool active;
    bool for_command;
    uint8_t next; /* 0: the hub itself; n: slot n - 1 */
    uint64_t next_us;
};

struct taxel_outbox {
    volatile size_t head; /* where the next frame goes: moved by the main loop only */
    volatile size_t tail; /* next byte for the UART: moved by its interrupt only */
    uint16_t sequence;
    uint32_t frames_sent, bytes_sent, frames_dropped;
};

struct taxel_inbox {
    volatile uint8_t head, tail;
    volatile bool holds; /* the host has been asked to hold back */
    volatile uint32_t overruns;
    uint32_t overruns_told;
    uint32_t commands, commands_rejected;
    uint8_t ring[TAXEL_HUB_RECEIVE_RING];
    uint8_t chunk[TAXEL_HUB_COMMAND_ENCODED_MAX];
    uint8_t body[TAXEL_FRAME_HEADER_SIZE + TAXEL_HUB_COMMAND_PAYLOAD_MAX + TAXEL_FRAME_CRC_SIZE];
    struct taxel_deframer deframer;
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
    uint64_t restart_by_us;
    uint64_t bus_down_until_us;
    uint64_t host_until_us; /* transfers of the host have the idle bus to themselves until then */
    uint64_t room_wanted_since_us; /* 0: nobody waits for room in the transmit ring */
    size_t room_wanted_tail;
    bool uart_is_stalled; /* polls go on without waiting for room */
    size_t unframed_size; /* of a snapshot that has been read but is not in the ring yet */
    uint32_t bus_recoveries;
    uint8_t unframed_slot; /* whose it is */
    uint8_t bus_fault; /* enum taxel_board_fault that bus recovery left */
    uint8_t slot_count;
    uint8_t version; /* negotiated; 0 before a hello */
    uint8_t next_buffer;
    uint8_t settings_read_slot; /* whose settings are to be read next, or 0xFF */
    uint8_t settings_read_kind; /* TAXEL_JOB_READ_SETTINGS or TAXEL_JOB_CHECK_SETTINGS */
    bool streaming;
    bool restart_wanted;
    bool bootloader_wanted;
};

/* Set up from a configuration that stays in place, and announce the start with a HUB_HELLO frame. */
void taxel_hub_init(struct taxel_hub *hub, const struct taxel_hub_config *config);
void taxel_hub_run(struct taxel_hub *hub);

void taxel_hub_on_i2c_done(struct taxel_hub *hub, int8_t result);
void taxel_hub_on_uart_byte(struct taxel_hub *hub, uint8_t byte);
size_t taxel_hub_uart_pull(struct taxel_hub *hub, uint8_t *bytes, size_t size);
size_t taxel_hub_uart_pending(const struct taxel_hub *hub);

#endif
