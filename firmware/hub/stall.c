/* Handling of a UART without a reader. Only the partly sent frame stays in the transfer pool; commands and polls use
 * the remaining space. */
#include <stdatomic.h>

#include "hub/internal.h"

#define UART_STALL_US 100000u
/* first bytes of a body: type, sequence, length, and the payload's first byte, a board's address */
#define PREFIX_SIZE 6u
#define PREFIX_SEQUENCE 1u
#define PREFIX_ADDRESS TAXEL_FRAME_HEADER_SIZE

/* Decode the first PREFIX_SIZE bytes of an encoded frame (COBS and whitening): type, sequence number, length, and the
 * I2C address of its board. `frame` begins with the delimiter. */
static void decode_prefix(const uint8_t *frame, uint8_t prefix[PREFIX_SIZE])
{
    uint8_t remaining = frame[1], whitening = (uint8_t)TAXEL_WHITENING_SEED;
    frame += 2;
    for (uint8_t i = 0; i < PREFIX_SIZE; i++, frame++) {
        prefix[i] = whitening;
        if (--remaining) {
            prefix[i] ^= *frame;
        } else {
            remaining = *frame; /* a block's code replaces a zero */
        }
        whitening = (uint8_t)(TAXEL_WHITENING_FACTOR * whitening + TAXEL_WHITENING_INCREMENT);
    }
}

/* Count a queued frame as dropped instead of forwarded. `frame` begins with the delimiter. Returns the sequence number
 * of the frame. The caller gives this number to a LOG frame: otherwise the number would be missing, because later
 * frames are already numbered. */
static uint16_t discard_frame(struct taxel_hub *hub, const uint8_t *frame)
{
    uint8_t prefix[PREFIX_SIZE];
    decode_prefix(frame, prefix);
    if (prefix[0] == TAXEL_FRAME_TYPE_LOG) {
        return taxel_get_u16(prefix + PREFIX_SEQUENCE); /* placeholder from an earlier stall: already counted */
    }
    if (prefix[0] != TAXEL_FRAME_TYPE_BOARD_INFO) {
        struct taxel_hub_slot *board = taxel_hub_slot_at(hub, taxel_hub_slot_of(hub, prefix[PREFIX_ADDRESS]));
        board->forwarded--;
        board->dropped++;
    }
    hub->outbox.frames_dropped++;
    return taxel_get_u16(prefix + PREFIX_SEQUENCE);
}

/* Discard the frames that wait in the transfer pool for a UART without a reader. Called without a transfer in
 * progress and without unframed bytes, so the whole pool is available; the interrupt is held. The partly sent frame
 * moves to the start of the pool. A short LOG frame takes the place and the sequence number of each other frame, so
 * that no number is missing. */
TAXEL_OWN_FRAME static void discard_queued(struct taxel_hub *hub)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    struct taxel_outbox *outbox = &hub->outbox;
    uint8_t *const pool = config->transfer_pool;
    const uint16_t sequence = outbox->sequence;
    uint16_t numbers[TAXEL_HUB_LARGE_MAX];
    outbox->is_held = true;
    atomic_signal_fence(memory_order_seq_cst);
    const uint8_t first_index = outbox->large_first;
    struct taxel_large *const first = &outbox->large[first_index];
    for (uint8_t i = 0; i < TAXEL_HUB_LARGE_MAX; i++) {
        const struct taxel_large *large = &outbox->large[i];
        if (i != first_index && large->remaining) {
            numbers[i] = discard_frame(hub, pool + large->end - large->remaining);
            outbox->bytes_sent -= large->remaining;
            outbox->frames_sent--;
        }
    }
    uint16_t end = 0;
    for (const uint8_t *from = pool + first->end - first->remaining; end < first->remaining; end++) {
        pool[end] = from[end];
    }
    first->end = end;
    if (end) { /* otherwise the frame has just been sent completely */
        outbox->large_next = taxel_hub_after_large(first_index);
    }
    for (uint8_t i; (i = outbox->large_next) != first_index && outbox->large[i].remaining;) {
        struct taxel_large *large = &outbox->large[i];
        const uint16_t mark = large->mark; /* frames in the ring keep their position between the large ones */
        /* NOLINTNEXTLINE(clang-analyzer-core.uninitialized.Assign): set above for every queued frame */
        outbox->sequence = numbers[i];
        /* the LOG frame becomes the entry `large` of the queue */
        taxel_hub_log_at(hub, TAXEL_LOG_LEVEL_WARNING, TAXEL_LOG_CODE_FRAME_DROPPED, "no reader", end);
        large->mark = mark;
        end = large->end;
    }
    outbox->sequence = sequence;
    atomic_signal_fence(memory_order_seq_cst);
    outbox->is_held = false;
    config->hal->uart_kick(config->hal->context);
}

/* Return whether the UART has taken no byte for 0.1 s. To be called repeatedly: each call compares the number of bytes
 * taken with that of the previous call. The start of a stall requests that queued frames be discarded. */
bool taxel_hub_uart_is_stalled(struct taxel_hub *hub)
{
    const uint32_t mark = hub->outbox.bytes_sent - (uint32_t)taxel_hub_uart_pending(hub);
    const uint32_t now = taxel_hub_now(hub);
    if (hub->uart_bytes_taken != mark) {
        hub->uart_bytes_taken = mark;
        hub->uart_progress_us = now;
        hub->uart_is_stalled = false;
    } else if (!hub->uart_is_stalled && now - hub->uart_progress_us >= UART_STALL_US) {
        hub->uart_is_stalled = hub->discard_requested = true;
    }
    return hub->uart_is_stalled;
}

/* Discard the queued frames after the start of a stall, unless the UART sends again. Waits until no transfer and no
 * unframed bytes use the pool. */
void taxel_hub_discard_queued(struct taxel_hub *hub)
{
    if (!hub->discard_requested || hub->job.kind != TAXEL_JOB_NONE || hub->unframed.size ||
        hub->settings_read_slot != TAXEL_NO_SLOT) {
        return;
    }
    if (taxel_hub_uart_is_stalled(hub)) {
        discard_queued(hub);
    }
    hub->discard_requested = false;
}
