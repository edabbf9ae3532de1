/* Outgoing UART frames. A frame is written completely, into the ring or around the bytes in the pool, or dropped and
 * counted if there is no space. */
#include <stdatomic.h>

#include "codec/encoder.h"
#include "hub/internal.h"

/* Return the number of bytes in the transmit ring that wait for the UART. */
static size_t used_bytes(const struct taxel_hub *hub)
{
    const size_t head = hub->outbox.head, tail = hub->outbox.tail;
    return head >= tail ? head - tail : head + taxel_hub_config_of(hub)->transmit_ring_size - tail;
}

/* Return the number of bytes queued for the UART, in the ring and in large frames (in the transfer pool). */
TAXEL_OWN_FRAME size_t taxel_hub_uart_pending(const struct taxel_hub *hub)
{
    size_t size = used_bytes(hub);
    for (uint8_t i = 0; i < TAXEL_HUB_LARGE_MAX; i++) {
        size += hub->outbox.large[i].remaining;
    }
    return size;
}

/* Copy up to `size` queued bytes for the UART to `bytes`; returns their number. Called from the UART interrupt. A
 * large frame is copied from the transfer pool once the UART has taken the ring's bytes up to the frame's mark, the
 * ring position at which the frame was queued. */
size_t taxel_hub_uart_pull(struct taxel_hub *hub, uint8_t *bytes, size_t size)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    struct taxel_outbox *outbox = &hub->outbox;
    size_t pulled = 0;
    atomic_signal_fence(memory_order_acquire);
    while (pulled < size && !outbox->is_held) {
        struct taxel_large *large = &outbox->large[outbox->large_first];
        const uint16_t remaining = large->remaining;
        const uint16_t tail = outbox->tail;
        if (remaining && tail == large->mark) {
            const uint8_t *from = &config->transfer_pool[large->end - remaining];
            size_t run = remaining < size - pulled ? remaining : size - pulled;
            large->remaining = (uint16_t)(remaining - run);
            if (remaining == run) {
                outbox->large_first = taxel_hub_after_large(outbox->large_first);
            }
            for (; run; run--) {
                bytes[pulled++] = *from++;
            }
        } else if (tail != outbox->head) {
            bytes[pulled++] = config->transmit_ring[tail];
            outbox->tail = tail + 1u == config->transmit_ring_size ? 0u : (uint16_t)(tail + 1u);
        } else {
            break;
        }
    }
    return pulled;
}

#define REPLY_MAX (TAXEL_REPLY_HEADER_SIZE + TAXEL_ADDRESS_MAX - TAXEL_ADDRESS_MIN + 1u) /* of SCAN_BUS: the longest */
#define REPLY_ENCODED_MAX taxel_encoded_size_max(REPLY_MAX)

/* Return the number of bytes of the transmit ring that are reserved for the next frame of a status report in progress.
 * Without this reserve, shorter and more frequent taxel frames would use all free space, the report would never end,
 * and GET_STATUS would block all other commands. */
static size_t report_reserve(const struct taxel_hub *hub)
{
    return hub->report.active ? taxel_encoded_size_max(TAXEL_HUB_STATUS_SIZE) : 0;
}

/* Return the number of bytes that a frame of this type must leave free in the transmit ring: every frame except
 * a reply or a handshake leaves space for one reply; a frame that can wait also leaves space for the small frames that
 * cannot wait. */
static size_t reserve_for(const struct taxel_hub *hub, uint8_t type)
{
    switch (type) {
    case TAXEL_FRAME_TYPE_REPLY:
    case TAXEL_FRAME_TYPE_HUB_HANDSHAKE:
        return 0;
    case TAXEL_FRAME_TYPE_TAXELS:
    case TAXEL_FRAME_TYPE_COMPACT_TAXELS:
    case TAXEL_FRAME_TYPE_BOARD_INFO:
        return TAXEL_HUB_REPLY_RESERVE + report_reserve(hub);
    case TAXEL_FRAME_TYPE_HUB_STATUS:
    case TAXEL_FRAME_TYPE_BOARD_STATUS:
        return TAXEL_HUB_REPLY_RESERVE;
    default:
        return REPLY_ENCODED_MAX; /* small frames never use the space of a reply */
    }
}

/* Return whether the transmit ring has space for the longest REPLY frame. */
bool taxel_hub_has_space_for_reply(const struct taxel_hub *hub)
{
    return used_bytes(hub) + REPLY_ENCODED_MAX < taxel_hub_config_of(hub)->transmit_ring_size;
}

/* Encode one frame (payload: `prefix` followed by `data`) into the transmit ring, or as a large frame at `pool_offset`,
 * and start the UART. Returns false if the ring has too little space after the reserve of its type. */
TAXEL_OWN_FRAME bool taxel_hub_emit(struct taxel_hub *hub, uint8_t type, const uint8_t *prefix, size_t prefix_size,
                                    const uint8_t *data, size_t data_size, uint16_t pool_offset)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    struct taxel_outbox *outbox = &hub->outbox;
    struct taxel_encoder encoder;
    if (pool_offset == TAXEL_HUB_IN_RING &&
        used_bytes(hub) + taxel_encoded_size_max(prefix_size + data_size) + reserve_for(hub, type) >=
            config->transmit_ring_size) {
        return false;
    }
    uint8_t *base = config->transmit_ring;
    size_t capacity = config->transmit_ring_size, position = outbox->head;
    if (pool_offset != TAXEL_HUB_IN_RING) {
        base = config->transfer_pool;
        capacity = config->transfer_pool_size;
        position = pool_offset;
    }
    taxel_encoder_begin(&encoder, base, capacity, position, type, outbox->sequence,
                        (uint16_t)(prefix_size + data_size));
    taxel_encoder_put(&encoder, prefix, prefix_size);
    taxel_encoder_put(&encoder, data, data_size);
    const size_t length = taxel_encoder_end(&encoder);
    outbox->bytes_sent += (uint32_t)length;
    outbox->frames_sent++;
    outbox->sequence++;
    atomic_signal_fence(memory_order_release); /* the bytes are written before the interrupt can see the frame */
    if (pool_offset == TAXEL_HUB_IN_RING) {
        outbox->head = (uint16_t)taxel_encoder_position(&encoder);
    } else {
        struct taxel_large *large = &outbox->large[outbox->large_next];
        outbox->large_next = taxel_hub_after_large(outbox->large_next);
        large->end = (uint16_t)(pool_offset + length);
        large->mark = outbox->head;
        atomic_signal_fence(memory_order_release);
        large->remaining = (uint16_t)length;
    }
    config->hal->uart_kick(config->hal->context);
    return true;
}

/* Queue a frame whose payload is `prefix` (header of the payload; may be empty) followed by the `size` bytes that a
 * transfer read into the pool buffer at `pool_offset`. A large frame is a frame in the transfer pool.
 * - No large frame is queued: the new frame is encoded in place. The buffer is in use until the frame has been sent.
 * - A large frame is queued and the ring has space: the payload is copied into the ring. The buffer is free at once.
 * - A large frame is queued and the ring has no space: the new frame is encoded in place and queued as a large frame.
 * Returns false in the third case if no entry for a large frame is free, or if the UART is stalled. No frame is then
 * queued, and the buffer is free. */
bool taxel_hub_send_buffer(struct taxel_hub *hub, uint8_t type, const uint8_t *prefix, size_t prefix_size,
                           uint16_t pool_offset, size_t size)
{
    struct taxel_outbox *outbox = &hub->outbox;
    const uint8_t *bytes = taxel_hub_bytes(hub, pool_offset);
    if (outbox->large[outbox->large_first].remaining) {
        if (taxel_hub_try_send(hub, type, prefix, prefix_size, bytes, size)) {
            return true;
        }
        if (outbox->large[outbox->large_next].remaining || (hub->uart_is_stalled && taxel_hub_uart_is_stalled(hub))) {
            return false;
        }
    }
    /* In-place encoding never overwrites bytes that are still to be read: the output is ahead by delimiter, header
     * and at most 2 + 2 bytes of stuffing, which the headroom covers. */
    return taxel_hub_emit(hub, type, prefix, prefix_size, bytes, size, pool_offset);
}

/* Queue a frame in the transmit ring. Without space the frame is dropped and counted; returns false. */
bool taxel_hub_send(struct taxel_hub *hub, uint8_t type, const uint8_t *prefix, size_t prefix_size, const uint8_t *data,
                    size_t data_size)
{
    if (taxel_hub_try_send(hub, type, prefix, prefix_size, data, data_size)) {
        return true;
    }
    hub->outbox.frames_dropped++;
    return false;
}

/* Queue a BOARD_FAULT frame; `fault`: enum taxel_board_fault, where RECOVERED reports the end of consecutive failures.
 */
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

/* Queue a LOG frame with a text; without space it is dropped and counted. `pool_offset`: position in the transfer pool,
 * or TAXEL_HUB_IN_RING for the transmit ring. */
void taxel_hub_log_at(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text, uint16_t pool_offset)
{
    uint8_t bytes[TAXEL_LOG_HEADER_SIZE];
    const struct taxel_log_header header = {
        .level = level,
        .code = code,
        .hub_time_us = taxel_hub_now(hub),
    };
    taxel_log_header_pack(&header, bytes);
    if (!taxel_hub_emit(hub, TAXEL_FRAME_TYPE_LOG, bytes, sizeof bytes, (const uint8_t *)text, strlen(text),
                        pool_offset)) {
        hub->outbox.frames_dropped++;
    }
}

/* Queue a LOG frame for the host in the transmit ring. `level`: enum taxel_log_level; `code`: enum taxel_log_code;
 * `text`: ASCII, at most 64 characters. */
void taxel_hub_log(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text)
{
    taxel_hub_log_at(hub, level, code, text, TAXEL_HUB_IN_RING);
}
