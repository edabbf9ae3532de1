/* A PC's way to decode: bytes in, a table of frames and one array of counts out. Built into the library that the Python
 * host loads; not part of the firmware images. */
#ifndef TAXEL_BATCH_H
#define TAXEL_BATCH_H

#include "codec/deframer.h"
#include "generated/taxel_protocol.h"

enum taxel_batch_flag {
    TAXEL_BATCH_BOARD_CRC_BAD = 1, /* hub and wire were right, the board's own CRC-32 is not */
};

/* One frame. For a taxel frame `offset` and `size` are an index and a number of counts; for others, of payload bytes. */
struct taxel_batch_row {
    uint64_t stream_position; /* bytes of the stream up to the end of this frame */
    uint32_t hub_time_us;
    uint32_t board_time_us;
    uint32_t offset;
    uint16_t size;
    uint16_t sequence;
    uint16_t cycle;
    uint16_t board_sequence;
    uint8_t type;
    uint8_t address;
    uint8_t flags;
    uint8_t reserved;
};

struct taxel_batch {
    struct taxel_deframer deframer;
    struct taxel_batch_row *rows;
    uint16_t *counts;
    uint8_t *payloads;
    size_t row_capacity, count_capacity, payload_capacity;
    size_t row_count, count_count, payload_count;
    uint8_t chunk[2u * (TAXEL_ENCODED_MAX + 2u)];
    uint8_t body[TAXEL_BODY_MAX];
};

size_t taxel_batch_struct_size(void);
size_t taxel_batch_row_size(void);
void taxel_batch_init(struct taxel_batch *batch, uint8_t directions);

/* Decode into the three caller-owned arrays from their start. Returns the bytes taken: less than `size` when an array is
 * nearly full. *row_count frames were found; totals are in the deframer. */
size_t taxel_batch_decode(struct taxel_batch *batch, const uint8_t *bytes, size_t size, struct taxel_batch_row *rows,
                          size_t row_capacity, uint16_t *counts, size_t count_capacity, uint8_t *payloads,
                          size_t payload_capacity, size_t *row_count);
void taxel_batch_finish(struct taxel_batch *batch, struct taxel_batch_row *rows, size_t row_capacity, uint16_t *counts,
                        size_t count_capacity, uint8_t *payloads, size_t payload_capacity, size_t *row_count);
uint64_t taxel_batch_discarded_bytes(const struct taxel_batch *batch);

/* Encode one frame into `out`; returns its bytes on the wire, or 0 if `capacity` is too small. */
size_t taxel_batch_encode(uint8_t type, uint16_t sequence, const uint8_t *payload, uint16_t length, uint8_t *out,
                          size_t capacity);

#endif
