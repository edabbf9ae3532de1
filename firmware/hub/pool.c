/* The transfer pool: transfers read into it, and frames are sent from it without a copy. It holds many small
 * snapshots or two of the largest. Buffers are allocated in order of time, as in a ring: queued frames, unframed
 * bytes, the transfer in progress. */
#include <stdatomic.h>

#include "hub/internal.h"

/* Set hub->job.pool_offset to a free part of the transfer pool, the memory for bytes read over I2C, for a transfer that
 * reads `size` bytes. Returns false if no part is free at present. The pool is used as a ring. Its occupied part begins
 * at `begin` and ends before `end`. It contains the large frames (queued frames in the pool) from the oldest to the
 * newest, then the unframed bytes (bytes that were read and are not yet a frame). */
bool taxel_hub_find_buffer(struct taxel_hub *hub, size_t size)
{
    const struct taxel_outbox *outbox = &hub->outbox;
    const size_t need = TAXEL_HUB_BUFFER_SIZE(size), pool = taxel_hub_config_of(hub)->transfer_pool_size;
    uint8_t index = outbox->large_next;
    size_t begin = 0, end = 0;
    uint8_t needed = index; /* entries are used in order: if this one is free, so are the earlier ones */
    if (hub->unframed.size) {
        begin = hub->unframed.pool_offset;
        end = begin + TAXEL_HUB_BUFFER_SIZE(hub->unframed.size);
        needed = taxel_hub_after_large(index);
    }
    if (outbox->large[needed].remaining && !hub->uart_is_stalled) {
        return false;
    }
    /* newest first, because the interrupt may finish the oldest at any time */
    for (unsigned i = 0; i < TAXEL_HUB_LARGE_MAX; i++) {
        index = index ? (uint8_t)(index - 1u) : TAXEL_HUB_LARGE_MAX - 1u;
        const uint16_t remaining = outbox->large[index].remaining;
        if (remaining) {
            const size_t sent_to = outbox->large[index].end;
            end = end ? end : sent_to;
            begin = sent_to - remaining; /* bytes already sent are free */
        }
    }
    atomic_signal_fence(memory_order_acquire);
    size_t offset = end;
    if (end > begin && end + need > pool) {
        offset = 0;
    } else if (end >= begin && 3u * need > pool && end + 2u * need > pool) {
        offset = pool - need; /* at the end of the pool: a second large buffer then fits before this one */
    }
    /* A buffer must not end where the oldest one begins: the pool would look empty. */
    if (end && offset <= begin ? offset + need >= begin : offset + need > pool) {
        return false;
    }
    hub->job.pool_offset = (uint16_t)offset;
    return true;
}
