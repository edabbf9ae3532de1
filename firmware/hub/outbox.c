/* UART frames out. A frame goes into the ring, or becomes of a transfer buffer, whole or not at all; what finds no room is dropped
 * whole, and counted. */
#include <stdatomic.h>

#include "codec/encoder.h"
#include "hub/internal.h"

static size_t used_bytes(const struct taxel_hub *hub)
{
    const size_t head = hub->outbox.head, tail = hub->outbox.tail;
    return head >= tail ? head - tail : head + taxel_hub_config_of(hub)->transmit_ring_size - tail;
}

size_t taxel_hub_uart_pending(const struct taxel_hub *hub)
{
    return used_bytes(hub) + hub->outbox.large_left;
}

size_t taxel_hub_uart_pull(struct taxel_hub *hub, uint8_t *bytes, size_t size)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    struct taxel_outbox *outbox = &hub->outbox;
    size_t pulled = 0;
    atomic_signal_fence(memory_order_acquire);
    for (; pulled < size; pulled++) {
        const uint16_t left = outbox->large_left;
        const uint16_t tail = outbox->tail;
        if (left && tail == outbox->large_mark) {
            bytes[pulled] = *(outbox->large_end - left);
            outbox->large_left = (uint16_t)(left - 1u);
        } else if (tail != outbox->head) {
            bytes[pulled] = config->transmit_ring[tail];
            outbox->tail = tail + 1u == config->transmit_ring_size ? 0u : (uint16_t)(tail + 1u);
        } else {
            break;
        }
    }
    return pulled;
}

#define REPLY_MAX (TAXEL_REPLY_HEADER_SIZE + TAXEL_ADDRESS_MAX - TAXEL_ADDRESS_MIN + 1u) /* of SCAN_BUS: the longest */
#define REPLY_ENCODED_MAX taxel_encoded_size_max(REPLY_MAX)

/* While a report is under way, its next frame has a place of its own: taxel frames, which may be shorter and come more often,
 * would take every gap, the report would never end, and GET_STATUS would keep all other commands waiting. */
static size_t report_reserve(const struct taxel_hub *hub)
{
    return hub->report.active ? taxel_encoded_size_max(TAXEL_HUB_STATUS_SIZE) : 0;
}

/* Room that a frame of this type must leave in the ring: all but answers leave some for an answer, frames that can wait also for
 * small frames that cannot. */
static size_t reserve_for(const struct taxel_hub *hub, uint8_t type)
{
    switch (type) {
    case TAXEL_FRAME_TYPE_REPLY:
    case TAXEL_FRAME_TYPE_HUB_HELLO:
        return 0;
    case TAXEL_FRAME_TYPE_TAXELS:
    case TAXEL_FRAME_TYPE_COMPACT_TAXELS:
    case TAXEL_FRAME_TYPE_BOARD_INFO:
        return TAXEL_HUB_REPLY_RESERVE + report_reserve(hub);
    case TAXEL_FRAME_TYPE_HUB_STATUS:
    case TAXEL_FRAME_TYPE_BOARD_STATUS:
        return TAXEL_HUB_REPLY_RESERVE;
    default:
        return REPLY_ENCODED_MAX; /* small frames never cost an answer */
    }
}

bool taxel_hub_has_room_for_reply(const struct taxel_hub *hub)
{
    return used_bytes(hub) + REPLY_ENCODED_MAX < taxel_hub_config_of(hub)->transmit_ring_size;
}

static void count(struct taxel_hub *hub, size_t size)
{
    struct taxel_outbox *outbox = &hub->outbox;
    outbox->bytes_sent += (uint32_t)size;
    outbox->frames_sent++;
    outbox->sequence++;
    atomic_signal_fence(memory_order_release); /* the bytes are in place before the interrupt may see them */
}

bool taxel_hub_try_send(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail,
                        size_t tail_size)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    struct taxel_outbox *outbox = &hub->outbox;
    struct taxel_encoder encoder;
    const size_t length = head_size + tail_size;
    if (used_bytes(hub) + taxel_encoded_size_max(length) + reserve_for(hub, type) >= config->transmit_ring_size) {
        return false;
    }
    taxel_encoder_begin(&encoder, config->transmit_ring, config->transmit_ring_size, outbox->head, type, outbox->sequence,
                        (uint16_t)length);
    taxel_encoder_put(&encoder, head, head_size);
    taxel_encoder_put(&encoder, tail, tail_size);
    count(hub, taxel_encoder_end(&encoder));
    outbox->head = (uint16_t)taxel_encoder_position(&encoder);
    config->hal->uart_kick(config->hal->context);
    return true;
}

bool taxel_hub_try_send_buffer(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, uint8_t buffer,
                               size_t size)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    struct taxel_outbox *outbox = &hub->outbox;
    struct taxel_encoder encoder;
    uint8_t *const bytes = config->transfer_buffers[buffer];
    if (outbox->large_left) {
        return taxel_hub_try_send(hub, type, head, head_size, bytes + TAXEL_HUB_HEADROOM, size);
    }
    /* What is written stays behind what is still to be read: delimiter, header and at most 2 + 2 bytes of stuffing. */
    taxel_encoder_begin(&encoder, bytes, config->transfer_buffer_size, 0, type, outbox->sequence, (uint16_t)(head_size + size));
    taxel_encoder_put(&encoder, head, head_size);
    taxel_encoder_put(&encoder, bytes + TAXEL_HUB_HEADROOM, size);
    const size_t length = taxel_encoder_end(&encoder);
    outbox->large_end = bytes + length;
    outbox->large_mark = outbox->head;
    outbox->large_buffer = buffer;
    count(hub, length);
    outbox->large_left = (uint16_t)length;
    config->hal->uart_kick(config->hal->context);
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
        .hub_time_us = taxel_hub_now(hub),
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
        .hub_time_us = taxel_hub_now(hub),
    };
    taxel_log_header_pack(&header, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_LOG, bytes, sizeof bytes, (const uint8_t *)text,
                         length < TAXEL_LOG_TEXT_MAX ? length : TAXEL_LOG_TEXT_MAX);
}
