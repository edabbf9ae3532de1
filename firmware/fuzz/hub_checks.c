/* Checks of the hub on the bench: buffers of its transfers, frames that the host receives, slots, positions, counters
 * and flow control. */
#include "fuzz/hub_bench.h"

#define ENDED_COUNTERS(s) \
    ((s)->forwarded + (s)->repeated + (s)->nacks + (s)->timeouts + (s)->crc_errors + (s)->bus_errors + (s)->dropped)

/* Check that two ranges of bytes, each from its begin up to but not including its end, do not overlap. */
static void check_disjoint(size_t begin, size_t end, size_t other_begin, size_t other_end)
{
    FUZZ_CHECK(end <= other_begin || other_end <= begin);
}

/* Check the buffer of a transfer that reads `size` bytes to `offset` of the transfer pool. The offset must be that of
 * the job's buffer. The bytes with their headroom and tailroom (space for the frame around them) must lie inside the
 * pool, and must overlap no buffer that waits for transmission. */
void bench_check_buffer(size_t offset, size_t size)
{
    const struct taxel_hub *const hub = &bench.hub;
    const size_t begin = hub->job.pool_offset, end = offset + size + TAXEL_HUB_TAILROOM;
    /* the settings of a board (12 bytes with CRC) are read to the space after its identity in the same buffer */
    FUZZ_CHECK(offset == begin + TAXEL_HUB_HEADROOM ||
               (offset == begin + TAXEL_HUB_HEADROOM + TAXEL_IDENTITY_SIZE && size == 12));
    FUZZ_CHECK(end <= bench.config.transfer_pool_size);
    if (hub->unframed.size) {
        check_disjoint(begin, end, hub->unframed.pool_offset,
                       hub->unframed.pool_offset + TAXEL_HUB_BUFFER_SIZE(hub->unframed.size));
    }
    for (size_t i = 0; i < TAXEL_HUB_LARGE_MAX; i++) {
        const struct taxel_large *const large = &hub->outbox.large[i];
        if (large->remaining) {
            check_disjoint(begin, end, large->end - large->remaining, large->end);
        }
    }
}

/* Check one frame that the host receives (handler of the deframer): sequence number, CRCs of the board, counters of
 * status frames. Replies to commands are counted. */
void bench_check_frame(void *context, const struct taxel_frame *frame)
{
    const uint8_t *payload = frame->payload;
    (void)context;
    FUZZ_CHECK(frame->type != TAXEL_FRAME_TYPE_COMPACT_TAXELS || bench.compact_requested);
    FUZZ_CHECK(frame->sequence == (uint16_t)bench.frames_pulled);
    bench.frames_pulled++;
    if (frame->type == TAXEL_FRAME_TYPE_TAXELS || frame->type == TAXEL_FRAME_TYPE_COMPACT_TAXELS) {
        /* The CRC of the board covers its address (first byte of the payload) and the bytes after the hub's header. */
        const size_t size = frame->length - TAXEL_TAXEL_HEADER_SIZE;
        const uint32_t crc = fuzz_crc32(fuzz_crc32(0, payload, 1), payload + TAXEL_TAXEL_HEADER_SIZE, size - 4u);
        FUZZ_CHECK(crc == taxel_get_u32(payload + frame->length - 4));
    } else if (frame->type == TAXEL_FRAME_TYPE_BOARD_INFO) {
        FUZZ_CHECK(fuzz_crc32(0, payload, 54) == taxel_get_u32(payload + 54));
    } else if (frame->type == TAXEL_FRAME_TYPE_HUB_STATUS) {
        struct taxel_hub_status status;
        taxel_hub_status_unpack(&status, payload);
        FUZZ_CHECK((uint16_t)status.frames_sent == frame->sequence &&
                   status.boards_streaming <= bench.config.slot_capacity);
    } else if (frame->type == TAXEL_FRAME_TYPE_BOARD_STATUS) {
        struct taxel_board_status status;
        taxel_board_status_unpack(&status, payload);
        const uint32_t open_polls = status.polls - ENDED_COUNTERS(&status);
        FUZZ_CHECK(open_polls <= 1u);
        FUZZ_CHECK(status.state <= TAXEL_BOARD_STATE_INCOMPATIBLE);
    } else if (frame->type == TAXEL_FRAME_TYPE_REPLY) {
        bench.replies++;
        bench.replies_bad += payload[2] != TAXEL_REPLY_STATUS_OK;
        bench.replies_busy += payload[2] == TAXEL_REPLY_STATUS_BUSY;
    }
}

/* Check the hub's slots (one per known board): valid addresses in ascending order, every ended poll in exactly one
 * outcome counter, at most one poll in progress, and a valid number of taxels while streaming. */
static void check_slots(void)
{
    const struct taxel_hub *hub = &bench.hub;
    FUZZ_CHECK(hub->slot_count <= bench.config.slot_capacity);
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        const struct taxel_hub_slot *slot = &bench.config.slots[i];
        const bool is_polled =
            hub->job.slot == i && (hub->job.kind == TAXEL_JOB_POLL || hub->job.kind == TAXEL_JOB_PROBE_SLOT);
        const bool is_waiting =
            hub->unframed.size && hub->unframed.slot == i && hub->unframed.type != TAXEL_FRAME_TYPE_BOARD_INFO;
        const unsigned in_flight = (slot->retry_pending ? 1u : 0u) + (is_polled ? 1u : 0u) + (is_waiting ? 1u : 0u);
        FUZZ_CHECK(in_flight <= 1u);
        FUZZ_CHECK(slot->address >= TAXEL_ADDRESS_MIN && slot->address <= TAXEL_ADDRESS_MAX);
        FUZZ_CHECK(i == 0 || slot->address > slot[-1].address);
        FUZZ_CHECK(slot->state <= TAXEL_BOARD_STATE_INCOMPATIBLE &&
                   slot->polls == (uint8_t)(ENDED_COUNTERS(slot) + in_flight));
        FUZZ_CHECK(slot->state != TAXEL_BOARD_STATE_STREAMING ||
                   (slot->taxel_count >= 1 && slot->taxel_count <= TAXEL_TAXELS_MAX &&
                    10u + 2u * (size_t)slot->taxel_count <= taxel_hub_read_max(hub)));
    }
}

/* Check the hub's slots, the positions and counters of its queues, and its flow control after a pass of its main
 * loop. */
void bench_check_hub(void)
{
    const struct taxel_hub *hub = &bench.hub;
    check_slots();
    FUZZ_CHECK(hub->outbox.head < bench.config.transmit_ring_size &&
               hub->outbox.tail < bench.config.transmit_ring_size);
    FUZZ_CHECK(taxel_hub_uart_pending(hub) == hub->outbox.bytes_sent - (uint32_t)bench.bytes_pulled);
    FUZZ_CHECK(hub->job.kind == TAXEL_JOB_NONE || hub->job.slot == TAXEL_NO_SLOT || hub->job.slot < hub->slot_count);
    FUZZ_CHECK(hub->cycle.position <= hub->slot_count && hub->inbox.commands_rejected <= hub->inbox.commands);
    FUZZ_CHECK(hub->job.kind == TAXEL_JOB_NONE || hub->job_done || bench.done_us != BENCH_NEVER);
    const unsigned waiting = (uint8_t)(hub->inbox.head - hub->inbox.tail);
    /* The hub stops the host while few bytes of the receive ring are free, and lets it continue at RELEASE_SPACE. */
    FUZZ_CHECK(hub->inbox.is_holding == bench.host_is_held);
    FUZZ_CHECK(bench.host_is_held || waiting < TAXEL_HUB_RECEIVE_RING - 1u - TAXEL_HUB_HOLD_SPACE);
    FUZZ_CHECK(!bench.host_is_held || bench.restarted ||
               waiting > TAXEL_HUB_RECEIVE_RING - 1u - TAXEL_HUB_RELEASE_SPACE);
}
