#include "codec/batch.h"

#include "codec/crc32.h"
#include "codec/encoder.h"

/* One step searches at most a full chunk buffer plus the step itself. Both may be filled with frames without
 * delimiters, of which the shortest has 12 stuffed bytes. */
#define STEP (TAXEL_BATCH_CHUNK_SIZE / 2u)
#define SEARCHED_MAX (TAXEL_BATCH_CHUNK_SIZE + STEP)
#define FRAMES_MAX (SEARCHED_MAX / 12u)
/* the shortest compact frame has 30 bytes, with any number of taxels */
#define COUNTS_MAX (SEARCHED_MAX / 30u * TAXEL_COMPACT_TAXELS_MAX)

#define ONES_AND_FOUR_ZEROS 0xDEBB20E3u /* CRC register that held all ones, after four zero bytes */

/* Return the size of struct taxel_batch in bytes, for a caller in another language that allocates the struct. */
size_t taxel_batch_struct_size(void)
{
    return sizeof(struct taxel_batch);
}

/* Return the size of struct taxel_batch_row in bytes: a caller in another language checks its own definition against
 * it. */
size_t taxel_batch_row_size(void)
{
    return sizeof(struct taxel_batch_row);
}

/* Return the number of taxel frames of a board that are missing between two received frames, from the advances of the
 * poll cycle number (`cycles`) and of the board's scan number (`scans`). A board that scans more slowly than it is
 * polled has no new snapshot in some cycles, so at most `scans` - 1 frames can be missing. */
static uint16_t missing_between(uint16_t cycles, uint16_t scans)
{
    const uint16_t steps = cycles < scans ? cycles : scans;
    return steps ? (uint16_t)(steps - 1u) : 0;
}

/* Fill the members of a row that come from the header of a taxel frame, count missing frames of its board, and store
 * the poll cycle and scan numbers for the next frame. `skipped`: largest number of absent scans that do not count as
 * missing, because a board that is polled while it encodes a compact snapshot delivers nothing in this cycle, and a
 * newer snapshot in the next cycle. */
static void fill_header_and_count_missing(struct taxel_batch *batch, struct taxel_batch_row *row,
                                          const struct taxel_taxel_header *header, uint16_t skipped)
{
    const uint8_t address = header->address;
    row->address = address;
    row->cycle = header->cycle;
    row->hub_time_us = header->hub_time_us;
    if (batch->has_cycle[address]) {
        const uint16_t scans = (uint16_t)(row->board_sequence - batch->last_scan[address]);
        row->missing_before = missing_between((uint16_t)(header->cycle - batch->last_cycle[address]),
                                              scans > skipped ? (uint16_t)(scans - skipped) : 0);
        batch->totals.missing[address] += row->missing_before;
    }
    batch->has_cycle[address] = true;
    batch->last_cycle[address] = header->cycle;
    batch->last_scan[address] = row->board_sequence;
}

/* Decode a COMPACT_TAXELS frame into a row and its counts. Without the key frame, or with a wrong CRC of the board, the
 * row has a flag and no counts. */
static void store_compact(struct taxel_batch *batch, struct taxel_batch_row *row, const struct taxel_frame *frame)
{
    struct taxel_batch_output *output = batch->output;
    struct taxel_taxel_header header;
    struct taxel_compact_snapshot snapshot;
    const uint8_t *bytes = frame->payload + TAXEL_TAXEL_HEADER_SIZE;
    taxel_taxel_header_unpack(&header, frame->payload);
    row->board_sequence = taxel_get_u16(bytes + TAXEL_COMPACT_HEADER_OFFSET_SEQUENCE);
    row->offset = (uint32_t)output->count_count;
    switch (taxel_compact_receive(&batch->receivers[header.address], header.address, header.taxel_count, bytes,
                                  (size_t)frame->length - TAXEL_TAXEL_HEADER_SIZE, &snapshot)) {
    case TAXEL_COMPACT_OK:
        row->board_time_us = snapshot.timestamp_us;
        row->size = header.taxel_count;
        memcpy(output->counts + output->count_count, snapshot.counts, header.taxel_count * sizeof snapshot.counts[0]);
        output->count_count += header.taxel_count;
        batch->totals.received[header.address]++;
        break;
    case TAXEL_COMPACT_NO_KEY_FRAME:
        row->flags |= TAXEL_BATCH_NO_KEY_FRAME;
        batch->totals.undecoded[header.address]++;
        break;
    default:
        row->flags |= TAXEL_BATCH_BOARD_CRC_BAD;
        batch->totals.damaged[header.address]++;
        break;
    }
    fill_header_and_count_missing(batch, row, &header, 1); /* the scan that is skipped while the board encodes */
}

/* Convert `size` little-endian counts of 2 bytes each to numbers. restrict lets the compiler vectorise the loop. */
static void unpack_counts(uint16_t *restrict counts, const uint8_t *restrict bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        counts[i] = taxel_get_u16(bytes + 2u * i);
    }
}

/* Return the table that advances a CRC over `size` zero bytes; it is built at the first use of this size. Returns NULL
 * if all TAXEL_BATCH_SIZES tables are in use for other sizes. */
static const struct taxel_crc32_zeros *get_zeros_table(struct taxel_batch *batch, size_t size)
{
    for (size_t i = 0; i < batch->size_count; i++) {
        if (batch->after_header[i].size == size) {
            return &batch->after_header[i];
        }
    }
    if (batch->size_count == TAXEL_BATCH_SIZES) {
        return NULL;
    }
    struct taxel_crc32_zeros *zeros = &batch->after_header[batch->size_count++];
    taxel_crc32_zeros_init(zeros, size);
    return zeros;
}

/* Return whether the board's CRC is correct, in a frame whose own CRC is correct, without reading the snapshot again.
 * The frame's CRC covers header, snapshot and the board's CRC b; the board's CRC covers its I2C address and the same
 * snapshot. Let h and a be the CRC registers after the header and after the address, and x the effect of as many zero
 * bytes as the snapshot has on h ^ a. A CRC is linear, so after the snapshot the two registers differ by x.
 * If b is correct, b is the inverted register of address and snapshot. The frame's register before b is then ~b ^ x.
 * After b it is ~0 ^ x, advanced by four zero bytes, and must be equal to the inverted frame's CRC. The table `zeros`
 * advances h ^ a over snapshot and b together; ONES_AND_FOUR_ZEROS is ~0 advanced by four zero bytes. Without a table
 * (too many different sizes), the board's CRC is computed directly. */
static bool is_board_crc_correct(struct taxel_batch *batch, const struct taxel_frame *frame, uint8_t address)
{
    const uint8_t *body = frame->payload - TAXEL_FRAME_HEADER_SIZE,
                  *snapshot = frame->payload + TAXEL_TAXEL_HEADER_SIZE;
    const size_t size = (size_t)frame->length - TAXEL_TAXEL_HEADER_SIZE; /* with the board's CRC */
    const struct taxel_crc32_zeros *zeros = get_zeros_table(batch, size);
    if (!zeros) {
        return taxel_crc32(taxel_crc32(0, &address, 1), snapshot, size - 4u) == taxel_get_u32(snapshot + size - 4u);
    }
    const uint32_t difference = taxel_crc32(0, body, (size_t)(snapshot - body)) ^ taxel_crc32(0, &address, 1);
    return (~taxel_get_u32(snapshot + size) ^ ONES_AND_FOUR_ZEROS) == taxel_crc32_zeros_after(zeros, difference);
}

/* Decode a TAXELS frame into a row and its counts. A wrong CRC of the board is flagged; the counts are stored
 * nevertheless. */
static void store_taxels(struct taxel_batch *batch, struct taxel_batch_row *row, const struct taxel_frame *frame)
{
    struct taxel_batch_output *output = batch->output;
    struct taxel_taxel_header header;
    struct taxel_snapshot_header snapshot;
    const uint8_t *bytes = frame->payload + TAXEL_TAXEL_HEADER_SIZE;
    taxel_taxel_header_unpack(&header, frame->payload);
    taxel_snapshot_header_unpack(&snapshot, bytes);
    row->board_sequence = snapshot.sequence;
    row->board_time_us = snapshot.timestamp_us;
    row->offset = (uint32_t)output->count_count;
    row->size = header.taxel_count;
    unpack_counts(output->counts + output->count_count, bytes + TAXEL_SNAPSHOT_HEADER_SIZE, header.taxel_count);
    output->count_count += header.taxel_count;
    if (is_board_crc_correct(batch, frame, header.address)) {
        batch->totals.received[header.address]++;
    } else {
        row->flags |= TAXEL_BATCH_BOARD_CRC_BAD;
        batch->totals.damaged[header.address]++;
    }
    fill_header_and_count_missing(batch, row, &header, 0);
}

/* Return whether a frame is the first frame of a restarted hub: an unrequested HUB_HANDSHAKE with sequence 0 and tag
 * 0. */
static bool is_start_of_hub(const struct taxel_frame *frame)
{
    return frame->type == TAXEL_FRAME_TYPE_HUB_HANDSHAKE && frame->sequence == 0 &&
           frame->payload[TAXEL_HUB_HANDSHAKE_OFFSET_TAG] == 0;
}

/* Return whether a HUB_HANDSHAKE contains a shorter uptime of the hub than the last frame with an uptime (HUB_HANDSHAKE
 * or HUB_STATUS). This reveals a restart whose first frame was lost, for example because the port was closed. Also
 * stores the uptime of both frame types for the next call. */
static bool uptime_decreases(struct taxel_batch *batch, const struct taxel_frame *frame)
{
    size_t offset = TAXEL_HUB_HANDSHAKE_OFFSET_UPTIME_US;
    if (frame->type == TAXEL_FRAME_TYPE_HUB_STATUS) {
        offset = TAXEL_HUB_STATUS_OFFSET_UPTIME_US;
    } else if (frame->type != TAXEL_FRAME_TYPE_HUB_HANDSHAKE) {
        return false;
    }
    uint64_t uptime_us = 0;
    for (size_t i = 0; i < sizeof uptime_us; i++) {
        uptime_us |= (uint64_t)frame->payload[offset + i] << (8u * i);
    }
    const bool decreases = frame->type == TAXEL_FRAME_TYPE_HUB_HANDSHAKE && uptime_us < batch->uptime_us;
    batch->uptime_us = uptime_us;
    return decreases;
}

/* Discard the last poll cycle number of every board, so that no frames count as missing before the next frame of a
 * board. */
void taxel_batch_forget_cycles(struct taxel_batch *batch)
{
    memset(batch->has_cycle, 0, sizeof batch->has_cycle);
}

/* Count a received frame and `lost` frames before it, and store the sequence number expected next. */
static void count_frame(struct taxel_batch *batch, const struct taxel_frame *frame, uint16_t lost)
{
    batch->totals.frames++;
    batch->totals.lost += lost;
    batch->has_sequence = true;
    batch->next_sequence = (uint16_t)(frame->sequence + 1u);
}

/* Return the number of frames that are missing before a frame: the difference of its 16-bit sequence number from the
 * expected number; 0 for the first frame. */
static uint16_t compute_lost_before(const struct taxel_batch *batch, const struct taxel_frame *frame)
{
    return batch->has_sequence ? (uint16_t)(frame->sequence - batch->next_sequence) : 0;
}

/* Count a frame that this version defines and the frames lost before it, and set the loss and restart members of its
 * row. A restart of the hub begins a new sequence, without a loss. Frames lost before an unknown frame, which has no
 * row, are added to this row. */
static void count_sequence(struct taxel_batch *batch, struct taxel_batch_row *row, const struct taxel_frame *frame)
{
    const bool has_less_uptime = uptime_decreases(batch, frame);
    if (is_start_of_hub(frame) || has_less_uptime) {
        taxel_batch_forget_cycles(batch);
        row->flags |= batch->has_sequence ? TAXEL_BATCH_HUB_RESTARTED : 0;
        batch->totals.restarts += batch->has_sequence;
        count_frame(batch, frame, 0);
    } else {
        const uint16_t lost = compute_lost_before(batch, frame);
        row->lost_before = (uint16_t)(lost + batch->lost_before_unknown);
        count_frame(batch, frame, lost);
    }
    batch->lost_before_unknown = 0;
}

/* Handler of the deframer for a frame that this protocol version does not define: count the frame. In an accepted
 * direction, the sequence number of the frame also continues the sequence of received frames, so that the frame does
 * not count as lost. A frame of the other direction belongs to the sequence of another sender. */
static void count_unknown(void *context, const struct taxel_frame *frame)
{
    struct taxel_batch *batch = context;
    const uint8_t direction = frame->type & 0x80u ? TAXEL_DIRECTION_TO_HUB : TAXEL_DIRECTION_TO_HOST;
    batch->totals.unknown++;
    if (batch->deframer.config.directions & direction) {
        const uint16_t lost = compute_lost_before(batch, frame);
        batch->lost_before_unknown = (uint16_t)(batch->lost_before_unknown + lost);
        count_frame(batch, frame, lost);
    }
}

/* Handler of the deframer: append a valid frame to the taxel rows or, with its payload, to the message rows of the
 * output. */
static void store_frame(void *context, const struct taxel_frame *frame)
{
    struct taxel_batch *batch = context;
    struct taxel_batch_output *output = batch->output;
    const bool is_compact = frame->type == TAXEL_FRAME_TYPE_COMPACT_TAXELS;
    const bool is_taxels = is_compact || frame->type == TAXEL_FRAME_TYPE_TAXELS;
    struct taxel_batch_row *row =
        is_taxels ? &output->taxel_rows[output->taxel_count++] : &output->message_rows[output->message_count++];
    memset(row, 0, sizeof *row);
    row->stream_position = batch->deframer.position;
    row->type = frame->type;
    row->sequence = frame->sequence;
    row->length = frame->length;
    count_sequence(batch, row, frame);
    if (is_taxels) {
        (is_compact ? store_compact : store_taxels)(batch, row, frame);
        return;
    }
    row->offset = (uint32_t)output->payload_count;
    row->size = frame->length;
    memcpy(output->payloads + output->payload_count, frame->payload, frame->length);
    output->payload_count += frame->length;
}

/* Initialise a batch decoder. `directions`: which frames to accept (TAXEL_DIRECTION_TO_HOST, TAXEL_DIRECTION_TO_HUB).
 */
void taxel_batch_init(struct taxel_batch *batch, uint8_t directions)
{
    const struct taxel_deframer_config config = {
        .chunk = batch->chunk,
        .chunk_capacity = sizeof batch->chunk,
        .body = batch->body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = directions,
        .handler = store_frame,
        .unknown_handler = count_unknown,
        .context = batch,
    };
    memset(batch, 0, sizeof *batch);
    taxel_deframer_init(&batch->deframer, &config);
}

/* Select the arrays that receive the results of this call and mark them as empty. */
static void set_output(struct taxel_batch *batch, struct taxel_batch_output *output)
{
    batch->output = output;
    output->taxel_count = output->message_count = output->count_count = output->payload_count = 0;
}

/* Return whether the output arrays have space for everything that one call of the deframer can deliver. No space for
 * more payload bytes than searched bytes is needed: n stuffed bytes decode to fewer than n bytes of payload. */
static bool has_space(const struct taxel_batch *batch)
{
    const struct taxel_batch_output *output = batch->output;
    return output->row_capacity - output->taxel_count > FRAMES_MAX &&
           output->row_capacity - output->message_count > FRAMES_MAX &&
           output->count_capacity - output->count_count > COUNTS_MAX &&
           output->payload_capacity - output->payload_count > SEARCHED_MAX;
}

/* Decode stream bytes into rows until the bytes or the space of `output` are used up. Returns the number of bytes
 * taken. */
size_t taxel_batch_decode(struct taxel_batch *batch, const uint8_t *bytes, size_t size,
                          struct taxel_batch_output *output)
{
    size_t taken = 0;
    set_output(batch, output);
    while (taken < size && has_space(batch)) {
        const size_t remaining = size - taken;
        taken += taxel_deframer_push_chunk(&batch->deframer, bytes + taken, remaining < STEP ? remaining : STEP);
    }
    return taken;
}

/* Decode the bytes of an incomplete chunk at the end of the stream. Returns false if `output` has too little space. */
bool taxel_batch_finish(struct taxel_batch *batch, struct taxel_batch_output *output)
{
    set_output(batch, output);
    if (!has_space(batch)) {
        return false;
    }
    taxel_deframer_finish(&batch->deframer);
    return true;
}

/* Return the numbers of frames, losses and errors since the initialisation. The pointer stays valid as long as
 * `batch`. */
const struct taxel_batch_totals *taxel_batch_totals(const struct taxel_batch *batch)
{
    return &batch->totals;
}

/* Return the number of stream bytes since the initialisation that belonged to no valid frame; delimiters do not
 * count. */
uint64_t taxel_batch_discarded_bytes(const struct taxel_batch *batch)
{
    return batch->deframer.discarded_bytes;
}

/* Write the pending answers to key frames as the payload of an ACKNOWLEDGE frame and mark them as sent. An answer
 * either acknowledges a key frame by its id, or (FORGET) states that the host lacks the key frame, so that the board
 * sends a new one. Returns the size of the payload in bytes, 0 if no answer is pending. Answers that exceed `capacity`
 * stay pending. */
size_t taxel_batch_take_acknowledgements(struct taxel_batch *batch, uint8_t *payload, size_t capacity)
{
    size_t size = 0;
    for (unsigned address = 0; address < TAXEL_BATCH_ADDRESSES; address++) {
        struct taxel_compact_receiver *receiver = &batch->receivers[address];
        if (receiver->answer == TAXEL_COMPACT_ANSWER_NONE || size + TAXEL_ACKNOWLEDGEMENT_SIZE > capacity) {
            continue;
        }
        const bool forget = receiver->answer == TAXEL_COMPACT_ANSWER_FORGET;
        const struct taxel_acknowledgement answer = {
            .address = (uint8_t)(address | (forget ? TAXEL_ACKNOWLEDGE_FORGET : 0u)),
            .key_frame = forget ? 0 : receiver->pending.id,
        };
        taxel_acknowledgement_pack(&answer, payload + size);
        size += TAXEL_ACKNOWLEDGEMENT_SIZE;
        receiver->answer = TAXEL_COMPACT_ANSWER_NONE;
    }
    return size;
}

/* Encode one frame into `out`. Returns its length in bytes, or 0 if `capacity` is less than the largest encoded size of
 * this payload. */
size_t taxel_batch_encode(uint8_t type, uint16_t sequence, const uint8_t *payload, uint16_t length, uint8_t *out,
                          size_t capacity)
{
    struct taxel_encoder encoder;
    if (capacity < taxel_encoded_size_max(length)) {
        return 0;
    }
    taxel_encoder_begin(&encoder, out, capacity, 0, type, sequence, length);
    taxel_encoder_put(&encoder, payload, length);
    return taxel_encoder_end(&encoder);
}
