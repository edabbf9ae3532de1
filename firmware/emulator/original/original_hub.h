/* The firmware of the original hub: a poll cycle without timeouts, commands, checksums or sequence numbers.
 *
 *     general call (address 0x00, byte 0x01); if it fails, only the delay
 *     passes over the list of boards: read status and counts of each board that is not done;
 *         a board with the status 0xFFFE is sent to the UART and done; other boards are read again in the next pass
 *     delay of 50 ms
 *
 * A message is built when the counts have been read:
 *
 *     0x01 | length of the message | address | timestamp, ms, u32 big-endian | counts, u16 little-endian | 0x0A
 *
 * The port (hub_original.c) calls original_hub_run() at original_hub_next_time() and after every event. */
#ifndef EMULATOR_ORIGINAL_ORIGINAL_HUB_H
#define EMULATOR_ORIGINAL_ORIGINAL_HUB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/base/vtime.h"
#include "emulator/original/original_board.h"
#include "emulator/original/original_sender.h"
#include "emulator/original/original_settings.h"
#include "generated/taxel_original.h"
#include "hal/hub_hal.h"

#define ORIGINAL_MESSAGE_SIZE_MAX 256u
#define ORIGINAL_TRIES_MAIN 5u
#define ORIGINAL_TRIES_BRANCH 10u

enum original_hub_state {
    ORIGINAL_HUB_CALLS,  /* the general call is on the bus */
    ORIGINAL_HUB_READS,  /* the reply of a board is on the bus */
    ORIGINAL_HUB_SENDS,  /* the message waits for space in the ring */
    ORIGINAL_HUB_DELAYS, /* between two cycles */
    ORIGINAL_HUB_HANGS,  /* until the next reset */
};

/* Sums since power-up. The first five times add up to the time of the cycles. */
struct original_account {
    vtime call_time;     /* general call on the bus */
    vtime read_time;     /* reads that were sent to the UART */
    vtime retry_time;    /* failed tries: no acknowledge, or not ready */
    vtime blocked_time;  /* the main program waits for space in the ring */
    vtime delay_time;    /* delay after the cycle */
    vtime wire_time;     /* the UART's wire is busy */
    vtime pacing_time;   /* bytes wait for the interrupt of the UART driver while the wire is idle */
    uint64_t wire_bytes; /* bytes on the UART's wire */
    uint64_t messages;
    uint64_t failed_tries;
    uint64_t cycles; /* in which at least one message was sent */
    vtime time;      /* virtual time of this account */
};

struct original_hub_hal {
    void *context;
    void (*start_transfer)(void *context, const struct taxel_i2c_transfer *transfer);
    void (*start_transmit)(void *context); /* the UART has bytes to send */
};

struct original_hub {
    const struct original_settings *settings;
    struct original_hub_hal hal;
    struct original_sender sender;
    enum original_hub_state state;
    double clock_rate; /* of the hub's oscillator, relative to its nominal frequency */
    vtime reset_time;
    vtime delay_end;
    vtime wake; /* the main program continues then; VTIME_NEVER: it waits for an event */
    bool transfer_is_done;
    int8_t transfer_result;
    size_t board; /* of the present read, in the list */
    bool is_done[WORLD_BOARDS_MAX], is_offline[WORLD_BOARDS_MAX];
    uint8_t failed_tries[WORLD_BOARDS_MAX]; /* in this cycle */
    uint32_t timestamp_ms;                  /* sum of the 16-bit timer, as the interrupt updates it */
    uint64_t timer_start_ms;                /* when the timer was last set to 0 */
    /* Receive buffer and then the message, as they lie in the RAM of the hub: with the fault `receive_buffer` the
     * counts of a long read continue into the message. */
    uint8_t memory[ORIGINAL_READ_SIZE_MAX + 2u * ORIGINAL_MESSAGE_SIZE_MAX];
    size_t message_offset;
    uint8_t frame[ORIGINAL_MESSAGE_SIZE_MAX]; /* the message with start, length and end */
    vtime account_mark;                       /* the account is complete up to this time */
    uint64_t messages_before;                 /* number of messages at the end of the last counted cycle */
    struct original_account account;
    struct original_account first_cycle, last_cycle; /* account at the end of the first, and the last counted cycle */
};

void original_hub_init(struct original_hub *hub, const struct original_settings *settings,
                       const struct original_hub_hal *hal, double baud, double clock_rate);

/* Power up or reset the hub. The first cycle begins at `now`. */
void original_hub_reset(struct original_hub *hub, vtime now);

/* Report that the transfer has ended. result: enum taxel_i2c_result. */
void original_hub_on_transfer_done(struct original_hub *hub, int8_t result, vtime now);

/* Copy the next bytes to send when the UART's wire is free. Returns their number. */
size_t original_hub_pull(struct original_hub *hub, uint8_t *bytes, size_t size, vtime now);

/* Return when original_hub_run() must be called next. */
vtime original_hub_next_time(const struct original_hub *hub, vtime now);

/* Run one pass of the interrupt and of the main program at `now`. */
void original_hub_run(struct original_hub *hub, vtime now);

/* Return the sums of the counted cycles after the first one; all 0 before the end of the second one. */
struct original_account original_hub_measure_cycles(const struct original_hub *hub);

#endif
