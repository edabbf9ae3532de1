/* Declarations shared by the source files of the hub. */
#ifndef TAXEL_HUB_INTERNAL_H
#define TAXEL_HUB_INTERNAL_H

#include "hub/hub.h"

#define TAXEL_NO_SLOT 0xFFu
#define TAXEL_HUB_SPACE_POLL_US 100u /* interval of checks for space while the UART has too much to send */

/* Not inlined: its stack frame must not be part of the frame of a function with deeper calls. */
#define TAXEL_OWN_FRAME __attribute__((noinline))

#ifdef TAXEL_HUB_FIXED_CONFIG
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

/* Return the bytes read by the transfer whose buffer begins at `pool_offset`. */
static inline uint8_t *taxel_hub_bytes(const struct taxel_hub *hub, size_t pool_offset)
{
    return taxel_hub_config_of(hub)->transfer_pool + pool_offset + TAXEL_HUB_HEADROOM;
}

/* Return the largest number of bytes that one transfer can read. */
static inline size_t taxel_hub_read_max(const struct taxel_hub *hub)
{
    return taxel_hub_config_of(hub)->transfer_pool_size / 2u - TAXEL_HUB_BUFFER_SIZE(0u);
}

uint64_t taxel_hub_clock(const struct taxel_hub *hub);
/* Return the clock modulo 2^32, which halves the work on a Cortex-M0. Past and future times are distinguishable for 35
 * minutes; clamp_past_time() in hub.c updates times that may be older. */
uint32_t taxel_hub_now(const struct taxel_hub *hub);
/* Return whether `time` has come, for times that differ by less than 35 minutes. */
static inline bool taxel_hub_is_due(uint32_t now, uint32_t time)
{
    return (int32_t)(now - time) >= 0;
}
void taxel_hub_wake_in(const struct taxel_hub *hub, uint32_t microseconds);
uint8_t taxel_hub_slot_of(const struct taxel_hub *hub, uint8_t address);

/* One bit per address. A bus scan for SCAN_BUS keeps this map in the payload buffer, because the command has no
 * arguments. */
#define TAXEL_HUB_ADDRESS_BITMAP_SIZE 16u

/* schedule.c */
void taxel_hub_start_next_job(struct taxel_hub *hub);
void taxel_hub_start_streaming(struct taxel_hub *hub);
void taxel_hub_set_compact(struct taxel_hub *hub, bool compact);
/* Return the size in bytes of the longest compact snapshot of the board. */
static inline size_t taxel_hub_compact_max(const struct taxel_hub_slot *board)
{
    return (TAXEL_COMPACT_OVERHEAD_PACKED + 2u * (size_t)board->taxel_count + TAXEL_COMPACT_LENGTH_STEP - 1u) &
           ~(size_t)(TAXEL_COMPACT_LENGTH_STEP - 1u);
}
void taxel_hub_start_bus_scan(struct taxel_hub *hub, bool for_command);

/* pool.c: set hub->job.pool_offset to a free buffer for a transfer that reads `size` bytes; false if there is none
 * at present. Must not be called during a transfer. */
bool taxel_hub_find_buffer(struct taxel_hub *hub, size_t size);

/* launch.c: transfers into the buffer at hub->job.pool_offset */
/* Start a transfer that writes hub->job.write_bytes (write_size bytes) and then reads read_size bytes. */
void taxel_hub_launch(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t address, size_t read_size);
void taxel_hub_launch_read(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t pointer, size_t size);
void taxel_hub_launch_probe(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t address);
size_t taxel_hub_poll_size(const struct taxel_hub *hub, const struct taxel_hub_slot *board);
void taxel_hub_launch_poll(struct taxel_hub *hub, uint8_t slot);
void taxel_hub_launch_write_settings(struct taxel_hub *hub, uint8_t slot);
/* Write a pending acknowledgement to the board; false if there is none. */
bool taxel_hub_launch_acknowledge(struct taxel_hub *hub, uint8_t slot);

/* outcome.c */
void taxel_hub_finish_job(struct taxel_hub *hub, int8_t result);
/* Record a successful poll: report the end of consecutive failures. */
void taxel_hub_succeed(struct taxel_hub *hub, struct taxel_hub_slot *board);
/* Schedule a second poll of the board in this cycle; false if this was the second. */
bool taxel_hub_retry(struct taxel_hub *hub, struct taxel_hub_slot *board);
/* Record a failed poll of the board: update its state, and report the first of consecutive failures. */
void taxel_hub_fail(struct taxel_hub *hub, struct taxel_hub_slot *board, uint8_t fault);
/* Recover the bus and record a fault that remains. Returns this fault, or TAXEL_BOARD_FAULT_NONE. */
uint8_t taxel_hub_free_bus(struct taxel_hub *hub);
/* Clear the bus fault after a transfer that reached its stop condition, which proves that both lines move. */
void taxel_hub_note_result(struct taxel_hub *hub, int8_t result);

/* snapshot.c */
/* Record that the bytes read by the last transfer are to become a frame of this type. */
void taxel_hub_keep(struct taxel_hub *hub, uint8_t type, size_t size);
/* Record that the bytes read by the last poll are to become a frame. */
void taxel_hub_keep_snapshot(struct taxel_hub *hub);
/* Check the unframed snapshot, and forward it if it is valid and new. */
void taxel_hub_process_snapshot(struct taxel_hub *hub);
/* Frame the checked bytes and queue them. */
void taxel_hub_forward(struct taxel_hub *hub);

/* identify.c */
void taxel_hub_finish_identify(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result);
void taxel_hub_finish_read_settings(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result);
void taxel_hub_finish_check_settings(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result);

/* recovery.c. Recover the bus once. Returns the remaining fault (enum taxel_board_fault), or
 * TAXEL_BOARD_FAULT_NONE. */
uint8_t taxel_hub_recover_bus(struct taxel_hub *hub);

/* Return whether the transmit ring has space for the longest reply. */
bool taxel_hub_has_space_for_reply(const struct taxel_hub *hub);

/* outbox.c: write one frame to `pool_offset`, or into the ring for TAXEL_HUB_IN_RING. The payload is `prefix` followed
 * by `data`; either may be empty. Returns false if the ring has no space. */
#define TAXEL_HUB_IN_RING 0xFFFFu
bool taxel_hub_emit(struct taxel_hub *hub, uint8_t type, const uint8_t *prefix, size_t prefix_size, const uint8_t *data,
                    size_t data_size, uint16_t pool_offset);
static inline bool taxel_hub_try_send(struct taxel_hub *hub, uint8_t type, const uint8_t *prefix, size_t prefix_size,
                                      const uint8_t *data, size_t data_size)
{
    return taxel_hub_emit(hub, type, prefix, prefix_size, data, data_size, TAXEL_HUB_IN_RING);
}
/* Write one frame into the ring. Returns false if the ring has no space: the frame is dropped and counted. */
bool taxel_hub_send(struct taxel_hub *hub, uint8_t type, const uint8_t *prefix, size_t prefix_size, const uint8_t *data,
                    size_t data_size);
/* Queue a frame whose payload is `prefix` followed by the `size` bytes in the pool buffer at `pool_offset`: copied into
 * the ring if another buffer is queued and the ring has space, otherwise encoded in place. Returns false, and queues
 * nothing, if neither is possible: the ring has no space, and the UART is stalled or no large frame can be added. */
bool taxel_hub_send_buffer(struct taxel_hub *hub, uint8_t type, const uint8_t *prefix, size_t prefix_size,
                           uint16_t pool_offset, size_t size);
/* stall.c */
/* Return whether the UART has taken nothing for 0.1 s and therefore has no reader. To be called repeatedly while
 * waiting for the UART. */
bool taxel_hub_uart_is_stalled(struct taxel_hub *hub);
/* Discard the queued frames after the start of a stall. Called from the main loop itself, where enough stack is
 * free. */
void taxel_hub_discard_queued(struct taxel_hub *hub);
/* Return the index after `index` in the ring of large frames. */
static inline uint8_t taxel_hub_after_large(uint8_t index)
{
    return index == TAXEL_HUB_LARGE_MAX - 1u ? 0 : (uint8_t)(index + 1u);
}
void taxel_hub_send_fault(struct taxel_hub *hub, const struct taxel_hub_slot *slot, uint8_t fault);
/* `text`: at most TAXEL_LOG_TEXT_MAX bytes. */
void taxel_hub_log(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text);
/* As taxel_hub_log(), but as the next large frame, written at `pool_offset`. */
void taxel_hub_log_at(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text, uint16_t pool_offset);

/* inbox.c */
void taxel_hub_inbox_init(struct taxel_hub *hub);
void taxel_hub_read_inbox(struct taxel_hub *hub);

/* command.c */
void taxel_hub_handle_handshake(struct taxel_hub *hub);
void taxel_hub_handle_command(struct taxel_hub *hub, size_t size);
void taxel_hub_handle_acknowledgement(struct taxel_hub *hub, uint8_t address, uint16_t key_frame_id);
void taxel_hub_end_finished_command(struct taxel_hub *hub);
void taxel_hub_send_handshake(struct taxel_hub *hub, uint8_t tag, uint8_t version);
void taxel_hub_reply(struct taxel_hub *hub, uint8_t status, const uint8_t *data, size_t size);

/* report.c */
void taxel_hub_start_report(struct taxel_hub *hub, bool for_command);
void taxel_hub_report_step(struct taxel_hub *hub);

#endif
