/* What the hub's own source files share. */
#ifndef TAXEL_HUB_INTERNAL_H
#define TAXEL_HUB_INTERNAL_H

#include "hub/hub.h"

#define TAXEL_NO_SLOT 0xFFu
#define TAXEL_HUB_ROOM_POLL_US 100u /* how often a UART that has too much to send is looked at again */

/* What this function keeps on the stack is not wanted for long: it is not to become a part of one that calls deeper. */
#define TAXEL_OWN_FRAME __attribute__((noinline))

/* A program with one hub that is set up when it is built says so: the compiler then knows sizes and functions. */
#ifdef TAXEL_HUB_FIXED_CONFIG
extern const struct taxel_hub_config taxel_hub_fixed_config;
static inline const struct taxel_hub_config *taxel_hub_config_of(const struct taxel_hub *hub)
{
    (void)hub;
    return &taxel_hub_fixed_config;
}
#else
static inline const struct taxel_hub_config *taxel_hub_config_of(const struct taxel_hub *hub)
{
    return hub->config;
}
#endif

static inline const struct taxel_hub_hal *taxel_hub_hal_of(const struct taxel_hub *hub)
{
    return taxel_hub_config_of(hub)->hal;
}

static inline struct taxel_hub_slot *taxel_hub_slot_at(const struct taxel_hub *hub, uint8_t slot)
{
    return &taxel_hub_config_of(hub)->slots[slot];
}

/* What a transfer has read, or will, into that place of the pool. */
static inline uint8_t *taxel_hub_bytes(const struct taxel_hub *hub, size_t at)
{
    return taxel_hub_config_of(hub)->transfer_pool + at + TAXEL_HUB_HEADROOM;
}

static inline size_t taxel_hub_read_max(const struct taxel_hub *hub)
{
    return taxel_hub_config_of(hub)->transfer_pool_size / 2u - TAXEL_HUB_BUFFER_SIZE(0u);
}

uint64_t taxel_hub_clock(const struct taxel_hub *hub);
/* The same modulo 2^32: enough for all that is measured here, and half the work. A time that has come is told from one that has
 * not for 35 minutes; those that may wait longer are moved along (hub.c). */
uint32_t taxel_hub_now(const struct taxel_hub *hub);
static inline bool taxel_hub_has_come(uint32_t now, uint32_t time)
{
    return (int32_t)(now - time) >= 0;
}
void taxel_hub_wake_in(const struct taxel_hub *hub, uint32_t microseconds);
uint8_t taxel_hub_slot_of(const struct taxel_hub *hub, uint8_t address);

#define TAXEL_HUB_FOUND_SIZE 16u /* a bit an address: a sweep for SCAN_BUS, which has no arguments, keeps them as the payload */

/* schedule.c */
void taxel_hub_start_next_job(struct taxel_hub *hub);
void taxel_hub_start_streaming(struct taxel_hub *hub);
void taxel_hub_want_compact(struct taxel_hub *hub, bool compact);
/* The longest compact snapshot that a board may have. */
static inline size_t taxel_hub_compact_max(const struct taxel_hub_slot *board)
{
    return (TAXEL_COMPACT_OVERHEAD_MIN + 2u * (size_t)board->taxel_count + TAXEL_COMPACT_LENGTH_STEP - 1u) &
           ~(size_t)(TAXEL_COMPACT_LENGTH_STEP - 1u);
}
void taxel_hub_start_sweep(struct taxel_hub *hub, bool for_command);

/* pool.c: set hub->job.at to a place for a transfer that reads so much; false if there is none now. No transfer is under way. */
bool taxel_hub_find_place(struct taxel_hub *hub, size_t size);

/* launch.c: transfers into hub->job.at, where there is room for them */
/* Begin the transfer that hub->job describes so far: write_size, write_bytes. */
void taxel_hub_launch(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t address, size_t read_size);
void taxel_hub_launch_read(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t pointer, size_t size);
void taxel_hub_launch_probe(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t address);
size_t taxel_hub_poll_size(const struct taxel_hub *hub, const struct taxel_hub_slot *board);
void taxel_hub_launch_poll(struct taxel_hub *hub, uint8_t slot);
void taxel_hub_launch_write_settings(struct taxel_hub *hub, uint8_t slot);
/* What the host has to say to the board; false if it has nothing to say. */
bool taxel_hub_launch_acknowledge(struct taxel_hub *hub, uint8_t slot);

/* outcome.c */
void taxel_hub_finish_job(struct taxel_hub *hub, int8_t result);
/* A poll has brought what it was to bring: the end of a row of failures is reported. */
void taxel_hub_succeed(struct taxel_hub *hub, struct taxel_hub_slot *board);
/* Poll the board once more in this cycle; false if it has had its second attempt. */
bool taxel_hub_retry(struct taxel_hub *hub, struct taxel_hub_slot *board);
/* A poll of the board has failed: its state, and a report if it is the first in a row. */
void taxel_hub_fail(struct taxel_hub *hub, struct taxel_hub_slot *board, uint8_t fault);
/* Free the bus. Returns the fault that remains, or TAXEL_BOARD_FAULT_NONE. */
uint8_t taxel_hub_free_bus(struct taxel_hub *hub);
/* Any transfer that runs to its stop shows that both lines move. */
void taxel_hub_note_result(struct taxel_hub *hub, int8_t result);

/* snapshot.c */
/* What the last transfer has read is to become a frame of that type. */
void taxel_hub_keep(struct taxel_hub *hub, uint8_t type, size_t size);
/* The same for what a poll has read. */
void taxel_hub_keep_snapshot(struct taxel_hub *hub);
/* Judge the snapshot that is not framed yet, and forward it. */
void taxel_hub_take_snapshot(struct taxel_hub *hub);
/* What is not framed yet, and right: into a frame. */
void taxel_hub_forward(struct taxel_hub *hub);

/* identify.c */
void taxel_hub_finish_identify(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result);
void taxel_hub_finish_read_settings(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result);
void taxel_hub_finish_check_settings(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result);

/* recovery.c: 0, or the fault that remains (enum taxel_board_fault) */
uint8_t taxel_hub_recover_bus(struct taxel_hub *hub);

bool taxel_hub_has_room_for_reply(const struct taxel_hub *hub);

/* outbox.c: one frame of a head and a tail (either may be empty), to `at` of the pool or into the ring; false if that has no room */
#define TAXEL_HUB_IN_RING 0xFFFFu
bool taxel_hub_emit(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail, size_t tail_size,
                    uint16_t at);
static inline bool taxel_hub_try_send(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail,
                                      size_t tail_size)
{
    return taxel_hub_emit(hub, type, head, head_size, tail, tail_size, TAXEL_HUB_IN_RING);
}
/* the same for what cannot be kept: without room it is dropped and counted */
bool taxel_hub_send(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail,
                    size_t tail_size);
/* What was read into a place of the pool as a frame's tail: sent from where it is, or, while the UART has something else to send,
 * through the ring if that has room. False if nobody reads: then it is not sent. */
bool taxel_hub_send_place(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, uint16_t at, size_t size);
/* stall.c */
/* A UART that takes nothing for 0.1 s has no reader: go on, and drop. To be asked again and again by what waits for it. */
bool taxel_hub_uart_is_stalled(struct taxel_hub *hub);
/* What is in its way, when a stall has begun. From the main loop itself: there the stack has room for it. */
void taxel_hub_drop_queued(struct taxel_hub *hub);
static inline uint8_t taxel_hub_after_large(uint8_t index)
{
    return index == TAXEL_HUB_LARGE_MAX - 1u ? 0 : (uint8_t)(index + 1u);
}
void taxel_hub_send_fault(struct taxel_hub *hub, const struct taxel_hub_slot *slot, uint8_t fault);
/* `text`: no longer than TAXEL_LOG_TEXT_MAX. */
void taxel_hub_log(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text);
/* The same at a place of the pool, whose turn is the next large frame's. */
void taxel_hub_log_at(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text, uint16_t at);

/* inbox.c */
void taxel_hub_inbox_init(struct taxel_hub *hub);
void taxel_hub_read_inbox(struct taxel_hub *hub);

/* command.c */
void taxel_hub_take_handshake(struct taxel_hub *hub);
void taxel_hub_take_command(struct taxel_hub *hub, size_t size);
void taxel_hub_take_acknowledgement(struct taxel_hub *hub, uint8_t address, uint16_t reference);
void taxel_hub_end_finished_command(struct taxel_hub *hub);
void taxel_hub_send_handshake(struct taxel_hub *hub, uint8_t tag, uint8_t version);
void taxel_hub_reply(struct taxel_hub *hub, uint8_t status, const uint8_t *data, size_t size);

/* report.c */
void taxel_hub_start_report(struct taxel_hub *hub, bool for_command);
void taxel_hub_report_step(struct taxel_hub *hub);

#endif
