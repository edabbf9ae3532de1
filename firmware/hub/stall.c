/* A UART that nobody reads. It keeps no more of the pool than the frame that it has begun: commands and polls go on in the rest. */
#include <stdatomic.h>

#include "hub/internal.h"

#define UART_STALL_US 100000u
#define KNOWN 6u /* of a frame's body: type, sequence, length, and the payload's first byte, which is a board's address */
#define KNOWN_SEQUENCE 1u
#define KNOWN_ADDRESS TAXEL_FRAME_HEADER_SIZE

static void decode_beginning(const uint8_t *frame, uint8_t known[KNOWN])
{
    uint8_t left = frame[1], whitening = (uint8_t)TAXEL_WHITENING_SEED;
    frame += 2;
    for (uint8_t i = 0; i < KNOWN; i++, frame++) {
        known[i] = whitening;
        if (--left) {
            known[i] ^= *frame;
        } else {
            left = *frame; /* a block's code stands where a zero was */
        }
        whitening = (uint8_t)(TAXEL_WHITENING_FACTOR * whitening + TAXEL_WHITENING_INCREMENT);
    }
}

/* What was to be sent is dropped after all. Returns its number, which is on its way: other frames follow it. */
static uint16_t take_back(struct taxel_hub *hub, const uint8_t *frame)
{
    uint8_t known[KNOWN];
    decode_beginning(frame, known);
    if (known[0] == TAXEL_FRAME_TYPE_LOG) {
        return taxel_get_u16(known + KNOWN_SEQUENCE); /* of the stall before: it was dropped then */
    }
    if (known[0] != TAXEL_FRAME_TYPE_BOARD_INFO) {
        struct taxel_hub_slot *board = taxel_hub_slot_at(hub, taxel_hub_slot_of(hub, known[KNOWN_ADDRESS]));
        board->forwarded--;
        board->dropped++;
    }
    hub->outbox.frames_dropped++;
    return taxel_get_u16(known + KNOWN_SEQUENCE);
}

/* The interrupt takes nothing meanwhile. No transfer is under way, and nothing waits to be framed: the whole pool is this one's.
 * What is being sent moves to its beginning. So that no number is missing, a few words stand in the place of each other frame. */
TAXEL_OWN_FRAME static void drop_queued(struct taxel_hub *hub)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    struct taxel_outbox *outbox = &hub->outbox;
    uint8_t *const pool = config->transfer_pool;
    const uint16_t sequence = outbox->sequence;
    uint16_t numbers[TAXEL_HUB_LARGE_MAX];
    outbox->is_held = true;
    atomic_signal_fence(memory_order_seq_cst);
    const uint8_t begun = outbox->large_first;
    struct taxel_large *const first = &outbox->large[begun];
    for (uint8_t i = 0; i < TAXEL_HUB_LARGE_MAX; i++) {
        const struct taxel_large *large = &outbox->large[i];
        if (i != begun && large->left) {
            numbers[i] = take_back(hub, pool + large->end - large->left);
            outbox->bytes_sent -= large->left;
            outbox->frames_sent--;
        }
    }
    uint16_t end = 0;
    for (const uint8_t *from = pool + first->end - first->left; end < first->left; end++) {
        pool[end] = from[end];
    }
    first->end = end;
    if (end) { /* else all was sent a moment ago */
        outbox->large_next = taxel_hub_after_large(begun);
    }
    for (uint8_t i; (i = outbox->large_next) != begun && outbox->large[i].left;) {
        struct taxel_large *large = &outbox->large[i];
        const uint16_t mark = large->mark; /* what is in the ring has its place between them */
        outbox->sequence = numbers[i];
        taxel_hub_log_at(hub, TAXEL_LOG_LEVEL_WARNING, TAXEL_LOG_CODE_FRAME_DROPPED, "no reader", end); /* takes this entry */
        large->mark = mark;
        end = large->end;
    }
    outbox->sequence = sequence;
    atomic_signal_fence(memory_order_seq_cst);
    outbox->is_held = false;
    config->hal->uart_kick(config->hal->context);
}

bool taxel_hub_uart_is_stalled(struct taxel_hub *hub)
{
    const uint32_t mark = hub->outbox.bytes_sent - (uint32_t)taxel_hub_uart_pending(hub);
    const uint32_t now = taxel_hub_now(hub);
    if (hub->uart_mark != mark) {
        hub->uart_mark = mark;
        hub->uart_moved_us = now;
        hub->uart_is_stalled = false;
    } else if (!hub->uart_is_stalled && now - hub->uart_moved_us >= UART_STALL_US) {
        hub->uart_is_stalled = hub->drop_wanted = true;
    }
    return hub->uart_is_stalled;
}

void taxel_hub_drop_queued(struct taxel_hub *hub)
{
    if (!hub->drop_wanted || hub->job.kind != TAXEL_JOB_NONE || hub->unframed.size || hub->settings_read_slot != TAXEL_NO_SLOT) {
        return;
    }
    if (taxel_hub_uart_is_stalled(hub)) {
        drop_queued(hub);
    }
    hub->drop_wanted = false;
}
