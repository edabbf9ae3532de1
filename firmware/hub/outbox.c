/* UART frames out. A frame goes into the ring whole or not at all; what finds no room is dropped whole, and counted. */
#include <stdatomic.h>

#include "codec/encoder.h"
#include "hub/internal.h"

static size_t used_bytes(const struct taxel_hub *hub)
{
    const size_t size = hub->config->transmit_ring_size;
    return (hub->outbox.head + size - hub->outbox.tail) % size;
}

size_t taxel_hub_uart_pending(const struct taxel_hub *hub)
{
    return used_bytes(hub);
}

size_t taxel_hub_uart_pull(struct taxel_hub *hub, uint8_t *bytes, size_t size)
{
    struct taxel_outbox *outbox = &hub->outbox;
    size_t pulled = 0;
    atomic_signal_fence(memory_order_acquire);
    while (pulled < size && outbox->tail != outbox->head) {
        bytes[pulled++] = hub->config->transmit_ring[outbox->tail];
        outbox->tail = outbox->tail + 1u == hub->config->transmit_ring_size ? 0u : outbox->tail + 1u;
    }
    return pulled;
}

#define REPLY_ENCODED_MAX taxel_encoded_size_max(TAXEL_REPLY_HEADER_SIZE + 128u) /* the longest reply on the wire */

/* While a report is under way, its next frame has a place of its own: taxel frames, which may be shorter and come more often,
 * would take every gap, the report would never end, and GET_STATUS would keep all other commands waiting. */
static size_t report_reserve(const struct taxel_hub *hub)
{
    return hub->report.active ? taxel_encoded_size_max(TAXEL_HUB_STATUS_SIZE) : 0;
}

static size_t taxel_frame_size(size_t snapshot_size)
{
    return snapshot_size ? taxel_encoded_size_max(TAXEL_TAXEL_HEADER_SIZE + snapshot_size) : 0;
}

/* Room that a frame of this type must leave: all but answers leave some for an answer, taxel frames also for small frames
 * that cannot wait, and status frames, which can, leave the room that the snapshots under way were promised. */
static size_t reserve_for(const struct taxel_hub *hub, uint8_t type)
{
    switch (type) {
    case TAXEL_FRAME_TYPE_REPLY:
    case TAXEL_FRAME_TYPE_HUB_HELLO:
        return 0;
    case TAXEL_FRAME_TYPE_TAXELS:
        /* A poll that waited for its room has it promised; only when nobody reads are polls made without. */
        return TAXEL_HUB_REPLY_RESERVE + (hub->uart_is_stalled ? report_reserve(hub) : 0);
    case TAXEL_FRAME_TYPE_HUB_STATUS:
    case TAXEL_FRAME_TYPE_BOARD_STATUS:
        return TAXEL_HUB_REPLY_RESERVE + taxel_frame_size(hub->unframed_size) +
               taxel_frame_size(hub->job.kind == TAXEL_JOB_POLL ? hub->job.read_size : 0);
    default:
        return REPLY_ENCODED_MAX; /* small frames never cost an answer */
    }
}

bool taxel_hub_has_room_for_reply(const struct taxel_hub *hub)
{
    return used_bytes(hub) + REPLY_ENCODED_MAX < hub->config->transmit_ring_size;
}

bool taxel_hub_can_hold_snapshot(const struct taxel_hub *hub, size_t snapshot_size)
{
    return taxel_frame_size(snapshot_size) + TAXEL_HUB_REPLY_RESERVE < hub->config->transmit_ring_size;
}

bool taxel_hub_has_room_for_snapshot(const struct taxel_hub *hub, size_t snapshot_size)
{
    const size_t wanted = taxel_frame_size(snapshot_size) + taxel_frame_size(hub->unframed_size) + TAXEL_HUB_REPLY_RESERVE +
                          report_reserve(hub);
    return used_bytes(hub) + wanted < hub->config->transmit_ring_size;
}

bool taxel_hub_try_send(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail,
                        size_t tail_size)
{
    const struct taxel_hub_hal *hal = hub->config->hal;
    struct taxel_outbox *outbox = &hub->outbox;
    struct taxel_encoder encoder;
    const size_t length = head_size + tail_size;
    if (used_bytes(hub) + taxel_encoded_size_max(length) + reserve_for(hub, type) >= hub->config->transmit_ring_size) {
        return false;
    }
    taxel_encoder_begin(&encoder, hub->config->transmit_ring, hub->config->transmit_ring_size, outbox->head, type,
                        outbox->sequence, (uint16_t)length);
    taxel_encoder_put(&encoder, head, head_size);
    taxel_encoder_put(&encoder, tail, tail_size);
    outbox->bytes_sent += (uint32_t)taxel_encoder_end(&encoder);
    outbox->frames_sent++;
    outbox->sequence++;
    atomic_signal_fence(memory_order_release); /* the bytes are in place before the interrupt may see them */
    outbox->head = encoder.position;
    hal->uart_kick(hal->context);
    return true;
}

bool taxel_hub_send(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail,
                    size_t tail_size)
{
    if (taxel_hub_try_send(hub, type, head, head_size, tail, tail_size)) {
        return true;
    }
    hub->outbox.frames_dropped++;
    return false;
}

void taxel_hub_send_fault(struct taxel_hub *hub, const struct taxel_hub_slot *slot, uint8_t fault)
{
    uint8_t bytes[TAXEL_BOARD_FAULT_REPORT_SIZE];
    const struct taxel_board_fault_report report = {
        .address = slot->address,
        .fault = fault,
        .cycle = hub->cycle.number,
        .hub_time_us = (uint32_t)taxel_hub_clock(hub),
        .consecutive = slot->consecutive_failures,
    };
    taxel_board_fault_report_pack(&report, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_BOARD_FAULT, bytes, sizeof bytes, NULL, 0);
}

void taxel_hub_log(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text)
{
    uint8_t bytes[TAXEL_LOG_HEADER_SIZE];
    const size_t length = strlen(text);
    const struct taxel_log_header header = {
        .level = level,
        .code = code,
        .hub_time_us = (uint32_t)taxel_hub_clock(hub),
    };
    taxel_log_header_pack(&header, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_LOG, bytes, sizeof bytes, (const uint8_t *)text,
                         length < TAXEL_LOG_TEXT_MAX ? length : TAXEL_LOG_TEXT_MAX);
}
