/* A PC's way to decode: bytes in, a table of frames and one array of counts out. Built into the library that the Python
 * host loads; not part of the firmware images. */
#ifndef TAXEL_BATCH_H
#define TAXEL_BATCH_H

#include <stdbool.h>

#include "codec/compact_receiver.h"
#include "codec/crc32_zeros.h"
#include "codec/deframer.h"
#include "generated/taxel_protocol.h"

enum taxel_batch_flag {
    TAXEL_BATCH_BOARD_CRC_BAD = 1, /* hub and wire were right, the board's own CRC-32 is not */
    TAXEL_BATCH_HUB_RESTARTED = 2, /* a HUB_HANDSHAKE with sequence 0: the hub restarted, its sequences begin at 0 */
    TAXEL_BATCH_NO_REFERENCE = 4,  /* a compact snapshot, coded against what this host does not have: no counts */
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
    uint16_t lost_before;    /* frames that the hub sent between the last one that arrived and this one */
    uint16_t missing_before; /* frames of this board that should have come since its last one */
    uint8_t type;
    uint8_t address;
    uint8_t flags;
    uint8_t reserved;
    uint16_t length; /* of the payload */
};

/* Where a call puts what it decodes, and how much that was: the arrays are the caller's. */
struct taxel_batch_output {
    struct taxel_batch_row *taxels; /* taxel frames */
    struct taxel_batch_row *others; /* all other frames */
    uint16_t *counts;
    uint8_t *payloads;
    size_t row_capacity, count_capacity, payload_capacity; /* row_capacity: of each of the first two */
    size_t taxel_count, other_count, count_count, payload_count;
};

#define TAXEL_BATCH_ADDRESSES 128u
#define TAXEL_BATCH_SIZES 8u /* of boards; a hand has two or three kinds */
#define TAXEL_BATCH_CHUNK_SIZE (2u * (TAXEL_ENCODED_MAX + 2u))

/* Totals of a stream. Only 64-bit members: the Python host reads it as one array. */
struct taxel_batch_totals {
    uint64_t frames;
    uint64_t lost;     /* frames that the hub sent and that never arrived whole: gaps in their sequence */
    uint64_t restarts; /* of the hub */
    uint64_t received[TAXEL_BATCH_ADDRESSES]; /* taxel frames of each board */
    uint64_t missing[TAXEL_BATCH_ADDRESSES];  /* frames that should have come between two that did */
    uint64_t damaged[TAXEL_BATCH_ADDRESSES];  /* the board's own CRC was wrong */
    uint64_t undecoded[TAXEL_BATCH_ADDRESSES]; /* coded against a reference that is not known here */
};

struct taxel_batch {
    struct taxel_batch_totals totals;
    struct taxel_deframer deframer;
    struct taxel_batch_output *output;
    bool has_sequence;
    uint16_t next_sequence;
    bool has_cycle[TAXEL_BATCH_ADDRESSES];
    uint16_t last_cycle[TAXEL_BATCH_ADDRESSES];
    uint16_t last_scan[TAXEL_BATCH_ADDRESSES];
    struct taxel_compact_receiver receivers[TAXEL_BATCH_ADDRESSES];
    struct taxel_crc32_zeros beyond_header[TAXEL_BATCH_SIZES]; /* what follows a taxel header, a kind of board each */
    size_t size_count;
    uint8_t chunk[TAXEL_BATCH_CHUNK_SIZE];
    uint8_t body[TAXEL_BODY_MAX];
};

size_t taxel_batch_struct_size(void);
size_t taxel_batch_row_size(void);
void taxel_batch_init(struct taxel_batch *batch, uint8_t directions);

/* Decode from the start of the output's arrays. Returns the bytes taken: less than `size` when an array is nearly full. */
size_t taxel_batch_decode(struct taxel_batch *batch, const uint8_t *bytes, size_t size, struct taxel_batch_output *output);
/* The stream has ended: decode what is left. Returns false, and does nothing, if the arrays are too small for that. */
bool taxel_batch_finish(struct taxel_batch *batch, struct taxel_batch_output *output);
/* A host that starts a stopped stream: boards that the cut cycle had not come to are not missing. */
void taxel_batch_forget_cycles(struct taxel_batch *batch);
const struct taxel_batch_totals *taxel_batch_totals(const struct taxel_batch *batch);
uint64_t taxel_batch_discarded_bytes(const struct taxel_batch *batch);

/* Payload of an ACKNOWLEDGE frame with what boards wait for, `capacity` bytes at most; returns its length, 0: nothing to say.
 * What was fetched counts as sent. */
size_t taxel_batch_answers(struct taxel_batch *batch, uint8_t *payload, size_t capacity);

/* Encode one frame into `out`; returns its bytes on the wire, or 0 if `capacity` is too small. */
size_t taxel_batch_encode(uint8_t type, uint16_t sequence, const uint8_t *payload, uint16_t length, uint8_t *out,
                          size_t capacity);

#endif
