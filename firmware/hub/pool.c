/* Where transfers read to, and frames are sent from: one pool, in which what was read stays until it is sent, so that many small
 * snapshots, or two of the largest, have a place. What is in use follows in the order of time: frames, what is not framed yet,
 * the transfer under way; behind the end of the pool its beginning comes. */
#include <stdatomic.h>

#include "hub/internal.h"

bool taxel_hub_find_place(struct taxel_hub *hub, size_t size)
{
    const struct taxel_outbox *outbox = &hub->outbox;
    const size_t need = TAXEL_HUB_BUFFER_SIZE(size), pool = taxel_hub_config_of(hub)->transfer_pool_size;
    uint8_t index = outbox->large_next;
    size_t begin = 0, end = 0;
    uint8_t needed = index; /* entries are taken in turn: if this one is free, so are those before it */
    if (hub->unframed.size) {
        begin = hub->unframed.at;
        end = begin + TAXEL_HUB_BUFFER_SIZE(hub->unframed.size);
        needed = taxel_hub_after_large(index);
    }
    if (outbox->large[needed].left && !hub->uart_is_stalled) {
        return false;
    }
    for (unsigned i = 0; i < TAXEL_HUB_LARGE_MAX; i++) { /* from the newest on: the interrupt ends the oldest */
        index = index ? (uint8_t)(index - 1u) : TAXEL_HUB_LARGE_MAX - 1u;
        const uint16_t left = outbox->large[index].left;
        if (left) {
            const size_t sent_to = outbox->large[index].end;
            end = end ? end : sent_to;
            begin = sent_to - left; /* what has been sent is free */
        }
    }
    atomic_signal_fence(memory_order_acquire);
    size_t at = end;
    if (end > begin && end + need > pool) {
        at = 0;
    } else if (end >= begin && 3u * need > pool && end + 2u * need > pool) {
        at = pool - need; /* no other like it would fit behind it: so that one fits before it, once that has been sent */
    }
    if (end && at <= begin ? at + need >= begin : at + need > pool) { /* were it to end where the oldest begins, all would look free */
        return false;
    }
    hub->job.at = (uint16_t)at;
    return true;
}
