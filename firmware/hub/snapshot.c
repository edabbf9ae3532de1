/* Checks a snapshot's CRC and sequence, and forwards it to the host if it is valid and new. */
#include "codec/crc32.h"
#include "hub/internal.h"

#define CLOCK_SLACK_US 500000u /* twice the age of a snapshot, with margin */
#define CLOCK_SLACK_SHIFT 3    /* plus an eighth of the elapsed time, more than the error of any oscillator */
#define HALF_CLOCK_RANGE 0x80000000u

/* Return whether the snapshot's CRC is correct. The last four bytes of the snapshot are the CRC of the board's I2C
 * address and all bytes before the CRC. */
static bool snapshot_is_whole(const struct taxel_hub_slot *board, const uint8_t *bytes, size_t size)
{
    if (size < TAXEL_COMPACT_OVERHEAD_DELTA) {
        return false; /* shorter than any valid snapshot, compact or uncompressed */
    }
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &board->address, 1), bytes, size - 4u);
    return crc == taxel_get_u32(bytes + size - 4u);
}

/* Return whether the board has restarted since its last snapshot: its clock (`timestamp_us`) went back, or did not
 * advance as the hub's clock (`started_us`) did. Always false for a board without an earlier clock value. */
static bool board_was_restarted(const struct taxel_hub_slot *board, uint32_t started_us, uint32_t timestamp_us)
{
    const uint32_t elapsed = started_us - board->last_read_us;
    const uint32_t board_elapsed = timestamp_us - board->last_timestamp_us;
    const bool went_back = board_elapsed >= HALF_CLOCK_RANGE && elapsed < HALF_CLOCK_RANGE;
    const uint32_t ahead = board_elapsed - elapsed;
    const uint32_t difference = ahead < HALF_CLOCK_RANGE ? ahead : 0u - ahead;
    return board->has_clock && (went_back || difference > CLOCK_SLACK_US + (elapsed >> CLOCK_SLACK_SHIFT));
}

/* Record that `size` bytes read by the last transfer are to become a frame of this type for the host. The frame is
 * built while the next transfer runs. */
void taxel_hub_keep(struct taxel_hub *hub, uint8_t type, size_t size)
{
    struct taxel_unframed *unframed = &hub->unframed;
    unframed->size = (uint16_t)size;
    unframed->cycle = hub->job.cycle;
    unframed->started_us = hub->job.started_us;
    unframed->slot = hub->job.slot;
    unframed->pool_offset = hub->job.pool_offset;
    unframed->type = type & 0x7Fu; /* a bit field of 7 bits; frames to the host have smaller types */
    unframed->is_checked = false;
}

/* Record the bytes read by a successful poll as an unframed snapshot. The size of a compact snapshot follows from its
 * length byte, which is in the byte before the buffer; the size is limited to the bytes that were read. */
void taxel_hub_keep_snapshot(struct taxel_hub *hub)
{
    const struct taxel_job *job = &hub->job;
    if (!job->is_compact) {
        taxel_hub_keep(hub, TAXEL_FRAME_TYPE_TAXELS, job->read_size);
        return;
    }
    const size_t size = taxel_compact_size(taxel_hub_bytes(hub, job->pool_offset)[-1]);
    taxel_hub_keep(hub, TAXEL_FRAME_TYPE_COMPACT_TAXELS, size < job->read_size ? size : job->read_size - 1u);
}

/* Return the board's clock (microseconds, 32 bits) in a snapshot. A delta frame contains only the low 24 bits of the
 * clock. The result is then the time with these low bits that is nearest to the time expected from the hub's clock. */
static uint32_t timestamp_of(const struct taxel_hub_slot *board, const struct taxel_unframed *unframed,
                             const uint8_t *bytes, bool is_delta)
{
    if (unframed->type == TAXEL_FRAME_TYPE_TAXELS) {
        return taxel_get_u32(bytes + TAXEL_SNAPSHOT_HEADER_OFFSET_TIMESTAMP_US);
    }
    if (!is_delta) {
        return taxel_get_u32(bytes + TAXEL_COMPACT_PACKED_OFFSET_TIMESTAMP_US);
    }
    const uint32_t expected = board->last_timestamp_us + unframed->started_us - board->last_read_us;
    /* Both 24-bit values are shifted to the upper bits of a word, without the byte that follows the timestamp; the
     * signed shift of their difference by 8 bits to the right then restores its sign. */
    const uint32_t low = taxel_get_u32(bytes + TAXEL_COMPACT_DELTA_OFFSET_TIMESTAMP_LOW) << 8;
    return expected + (uint32_t)((int32_t)(low - (expected << 8)) >> 8);
}

/* Queue the unframed bytes (read correctly, but not yet a frame) as a frame. Snapshots get a header with I2C address,
 * poll cycle and the hub's time at the start of their poll. Returns false if no frame could be queued, see
 * taxel_hub_send_buffer(). */
static bool send_unframed(struct taxel_hub *hub, const struct taxel_hub_slot *board)
{
    const struct taxel_unframed *unframed = &hub->unframed;
    uint8_t head[TAXEL_TAXEL_HEADER_SIZE];
    const struct taxel_taxel_header header = {
        .address = board->address,
        .taxel_count = board->taxel_count,
        .cycle = unframed->cycle,
        .hub_time_us = unframed->started_us,
    };
    taxel_taxel_header_pack(&header, head);
    return taxel_hub_send_buffer(hub, unframed->type, head,
                                 unframed->type == TAXEL_FRAME_TYPE_BOARD_INFO ? 0 : sizeof head, unframed->pool_offset,
                                 unframed->size);
}

/* Queue the checked, unframed bytes as a frame and count the poll as forwarded or dropped. A BOARD_INFO frame is no
 * poll and changes no counter of the board. */
void taxel_hub_forward(struct taxel_hub *hub)
{
    struct taxel_unframed *unframed = &hub->unframed;
    struct taxel_hub_slot *board = taxel_hub_slot_at(hub, unframed->slot);
    const bool is_taxels = unframed->type != TAXEL_FRAME_TYPE_BOARD_INFO;
    if (send_unframed(hub, board)) {
        board->forwarded += is_taxels;
    } else {
        board->dropped += is_taxels;
        hub->outbox.frames_dropped++;
    }
    unframed->size = 0;
}

/* Evaluate the snapshot of the last poll, and return whether it is valid and new and is to be forwarded. A damaged
 * snapshot is read again or counted; a repeated one is counted. A restart of the board is reported, and its identity is
 * read again. */
static bool snapshot_is_new(struct taxel_hub *hub, struct taxel_hub_slot *board)
{
    const struct taxel_unframed *unframed = &hub->unframed;
    const uint8_t *bytes = taxel_hub_bytes(hub, unframed->pool_offset);
    if (!snapshot_is_whole(board, bytes, unframed->size)) {
        if (!taxel_hub_retry(hub, board)) {
            board->crc_errors++;
            taxel_hub_fail(hub, board, TAXEL_BOARD_FAULT_CRC);
        }
        return false;
    }
    const uint16_t sequence = taxel_get_u16(bytes); /* both formats begin with the sequence */
    const bool is_delta = unframed->type == TAXEL_FRAME_TYPE_COMPACT_TAXELS &&
                          !(bytes[TAXEL_COMPACT_HEADER_OFFSET_FORMAT] & TAXEL_COMPACT_WIDTH_MASK);
    const uint32_t timestamp_us = timestamp_of(board, unframed, bytes, is_delta);
    taxel_hub_succeed(hub, board);
    /* after a restart a board sends no delta frame */
    if (!is_delta && board_was_restarted(board, unframed->started_us, timestamp_us)) {
        board->last_fault = TAXEL_BOARD_FAULT_RESTARTED;
        board->state = TAXEL_BOARD_STATE_IDENTIFYING; /* another board, or other settings, may be present now */
        board->has_sequence = false;
        taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_RESTARTED);
    }
    board->has_clock = board->has_clock || !is_delta;
    if (board->has_sequence && sequence == board->last_sequence) {
        board->repeated++;
        return false;
    }
    board->has_sequence = true;
    board->last_sequence = sequence;
    board->last_timestamp_us = timestamp_us;
    board->last_read_us = unframed->started_us;
    return true;
}

/* Check the snapshot of the last poll and forward it if it is valid and new. A compact snapshot of length 0 means that
 * the board has no new scan. */
void taxel_hub_process_snapshot(struct taxel_hub *hub)
{
    struct taxel_hub_slot *board = taxel_hub_slot_at(hub, hub->unframed.slot);
    if (hub->unframed.size == 0) { /* a compact snapshot of length 0 */
        taxel_hub_succeed(hub, board);
        board->repeated++;
    } else if (!snapshot_is_new(hub, board)) {
        hub->unframed.size = 0;
    }
    hub->unframed.is_checked = true;
    if (hub->job.kind == TAXEL_JOB_NONE) {
        taxel_hub_start_next_job(hub); /* a job that waited for this check starts before the framing */
    }
    if (hub->unframed.size) {
        taxel_hub_forward(hub);
    }
}
