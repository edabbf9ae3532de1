#include "codec/batch.h"

#include "codec/crc32.h"
#include "codec/encoder.h"

/* One chunk of the longest kind can hold this many frames at most (the shortest frame is 14 stuffed bytes). */
#define FRAMES_PER_CHUNK ((2u * (TAXEL_ENCODED_MAX + 2u)) / 12u)

size_t taxel_batch_struct_size(void)
{
    return sizeof(struct taxel_batch);
}

size_t taxel_batch_row_size(void)
{
    return sizeof(struct taxel_batch_row);
}

static void store_taxels(struct taxel_batch *batch, struct taxel_batch_row *row, const struct taxel_frame *frame)
{
    struct taxel_taxel_header header;
    struct taxel_snapshot_header snapshot;
    const uint8_t *bytes = frame->payload + TAXEL_TAXEL_HEADER_SIZE;
    const size_t snapshot_size = (size_t)frame->length - TAXEL_TAXEL_HEADER_SIZE;
    taxel_taxel_header_unpack(&header, frame->payload);
    taxel_snapshot_header_unpack(&snapshot, bytes);
    row->address = header.address;
    row->cycle = header.cycle;
    row->hub_time_us = header.hub_time_us;
    row->board_sequence = snapshot.sequence;
    row->board_time_us = snapshot.timestamp_us;
    row->offset = (uint32_t)batch->count_count;
    row->size = header.taxel_count;
    for (size_t i = 0; i < header.taxel_count; i++) {
        batch->counts[batch->count_count++] = taxel_get_u16(bytes + TAXEL_SNAPSHOT_HEADER_SIZE + 2u * i);
    }
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &header.address, 1), bytes, snapshot_size - 4u);
    if (crc != taxel_get_u32(bytes + snapshot_size - 4u)) {
        row->flags |= TAXEL_BATCH_BOARD_CRC_BAD;
    }
}

static void store(void *context, const struct taxel_frame *frame)
{
    struct taxel_batch *batch = context;
    struct taxel_batch_row *row = &batch->rows[batch->row_count++];
    memset(row, 0, sizeof *row);
    row->stream_position = batch->deframer.position;
    row->type = frame->type;
    row->sequence = frame->sequence;
    if (frame->type == TAXEL_FRAME_TYPE_TAXELS) {
        store_taxels(batch, row, frame);
        return;
    }
    row->offset = (uint32_t)batch->payload_count;
    row->size = frame->length;
    memcpy(batch->payloads + batch->payload_count, frame->payload, frame->length);
    batch->payload_count += frame->length;
}

void taxel_batch_init(struct taxel_batch *batch, uint8_t directions)
{
    const struct taxel_deframer_config config = {
        .chunk = batch->chunk,
        .chunk_capacity = sizeof batch->chunk,
        .body = batch->body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = directions,
        .handler = store,
        .context = batch,
    };
    memset(batch, 0, sizeof *batch);
    taxel_deframer_init(&batch->deframer, &config);
}

static void set_output(struct taxel_batch *batch, struct taxel_batch_row *rows, size_t row_capacity, uint16_t *counts,
                       size_t count_capacity, uint8_t *payloads, size_t payload_capacity)
{
    batch->rows = rows;
    batch->counts = counts;
    batch->payloads = payloads;
    batch->row_capacity = row_capacity;
    batch->count_capacity = count_capacity;
    batch->payload_capacity = payload_capacity;
    batch->row_count = batch->count_count = batch->payload_count = 0;
}

/* A chunk of `length` stuffed bytes decodes to fewer than `length` bytes of payload, and half as many counts. */
static int has_room(const struct taxel_batch *batch)
{
    return batch->row_capacity - batch->row_count > FRAMES_PER_CHUNK &&
           batch->count_capacity - batch->count_count > sizeof batch->chunk / 2u &&
           batch->payload_capacity - batch->payload_count > sizeof batch->chunk;
}

size_t taxel_batch_decode(struct taxel_batch *batch, const uint8_t *bytes, size_t size, struct taxel_batch_row *rows,
                          size_t row_capacity, uint16_t *counts, size_t count_capacity, uint8_t *payloads,
                          size_t payload_capacity, size_t *row_count)
{
    size_t taken = 0;
    set_output(batch, rows, row_capacity, counts, count_capacity, payloads, payload_capacity);
    while (taken < size && has_room(batch)) {
        /* Bounded steps: a stream without delimiters must not outrun the room that has_room() has promised. */
        const size_t left = size - taken;
        taken += taxel_deframer_push_chunk(&batch->deframer, bytes + taken, left < sizeof batch->chunk / 2u ? left : sizeof batch->chunk / 2u);
    }
    *row_count = batch->row_count;
    return taken;
}

void taxel_batch_finish(struct taxel_batch *batch, struct taxel_batch_row *rows, size_t row_capacity, uint16_t *counts,
                        size_t count_capacity, uint8_t *payloads, size_t payload_capacity, size_t *row_count)
{
    set_output(batch, rows, row_capacity, counts, count_capacity, payloads, payload_capacity);
    if (has_room(batch)) {
        taxel_deframer_finish(&batch->deframer);
    }
    *row_count = batch->row_count;
}

uint64_t taxel_batch_discarded_bytes(const struct taxel_batch *batch)
{
    return batch->deframer.discarded_bytes;
}

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
