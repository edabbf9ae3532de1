/* Decoding on a PC: bytes in, tables of frames and one array of counts out. Built into the library that the Python
 * host loads; not part of the firmware images.
 *
 * Integration (`output` points to the caller's arrays and states their capacities):
 *
 *     static struct taxel_batch batch;
 *     taxel_batch_init(&batch, TAXEL_DIRECTION_TO_HOST);
 *     for (size_t done = 0; done < size;) {  // each piece of the stream
 *         done += taxel_batch_decode(&batch, bytes + done, size - done, &output);
 *         use(output.taxel_rows, output.taxel_count, output.counts);
 *         // send this ACKNOWLEDGE payload to the hub if its size is not 0:
 *         acknowledge_size = taxel_batch_take_acknowledgements(&batch, payload, sizeof payload);
 *     }
 *     taxel_batch_finish(&batch, &output);  // at the end of the stream
 */
#ifndef TAXEL_BATCH_H
#define TAXEL_BATCH_H

#include <stdbool.h>

#include "codec/compact_receiver.h"
#include "codec/crc32_zeros.h"
#include "codec/deframer.h"
#include "generated/taxel_protocol.h"

enum taxel_batch_flag {
    TAXEL_BATCH_BOARD_CRC_BAD = 1, /* the frame's CRC is correct, the board's own CRC-32 is wrong */
    TAXEL_BATCH_HUB_RESTARTED = 2, /* a HUB_HANDSHAKE with sequence 0: the hub restarted, its sequences begin at 0 */
    TAXEL_BATCH_NO_KEY_FRAME = 4,  /* a delta frame whose key frame this host does not have: no counts */
};

/* One frame. `offset` and `size`: first element and number of elements in `counts` (taxel frames) or `payloads`
 * (other frames). */
struct taxel_batch_row {
    uint64_t stream_position; /* bytes of the stream up to the end of this frame */
    uint32_t hub_time_us;
    uint32_t board_time_us;
    uint32_t offset;
    uint16_t size;
    uint16_t sequence;
    uint16_t cycle;
    uint16_t board_sequence;
    uint16_t lost_before;    /* frames that the hub sent between the previously received frame and this one */
    uint16_t missing_before; /* frames of this board that are missing since its previous frame */
    uint8_t type;
    uint8_t address;
    uint8_t flags;
    uint8_t reserved;
    uint16_t length; /* of the payload */
};

/* Output of a call: the caller's arrays, their capacities, and the number of elements written. */
struct taxel_batch_output {
    struct taxel_batch_row *taxel_rows;   /* taxel frames */
    struct taxel_batch_row *message_rows; /* all other frames */
    uint16_t *counts;
    uint8_t *payloads;
    size_t row_capacity, count_capacity, payload_capacity; /* row_capacity: of each of the row arrays */
    size_t taxel_count, message_count, count_count, payload_count;
};

#define TAXEL_BATCH_ADDRESSES 128u
#define TAXEL_BATCH_SIZES 8u /* number of different snapshot sizes in a hand that are handled fast */
#define TAXEL_BATCH_CHUNK_SIZE (2u * (TAXEL_ENCODED_MAX + 2u))

/* Totals of a stream. Only 64-bit members: the Python host reads this struct as one array. */
struct taxel_batch_totals {
    uint64_t frames;
    uint64_t lost;     /* frames that the hub sent and that were not received intact: gaps in their sequence */
    uint64_t restarts; /* of the hub */
    uint64_t unknown;  /* complete frames with a type or a length that this version does not define; part of `frames` */
    uint64_t received[TAXEL_BATCH_ADDRESSES];  /* taxel frames of each board */
    uint64_t missing[TAXEL_BATCH_ADDRESSES];   /* frames missing between two received frames */
    uint64_t damaged[TAXEL_BATCH_ADDRESSES];   /* the board's own CRC was wrong */
    uint64_t undecoded[TAXEL_BATCH_ADDRESSES]; /* delta frames without their key frame */
};

struct taxel_batch {
    struct taxel_batch_totals totals;
    struct taxel_deframer deframer;
    struct taxel_batch_output *output;
    bool has_sequence; /* next_sequence is known: a frame has been received */
    uint16_t next_sequence;
    uint64_t uptime_us;           /* of the hub, in the last frame that contains it */
    uint16_t lost_before_unknown; /* frames lost before unknown frames since the last row */
    bool has_cycle[TAXEL_BATCH_ADDRESSES];
    uint16_t last_cycle[TAXEL_BATCH_ADDRESSES];
    uint16_t last_scan[TAXEL_BATCH_ADDRESSES];
    struct taxel_compact_receiver receivers[TAXEL_BATCH_ADDRESSES];
    struct taxel_crc32_zeros after_header[TAXEL_BATCH_SIZES]; /* one per size of the bytes after a taxel header */
    size_t size_count;
    uint8_t chunk[TAXEL_BATCH_CHUNK_SIZE];
    uint8_t body[TAXEL_BODY_MAX];
};

size_t taxel_batch_struct_size(void);
size_t taxel_batch_row_size(void);
void taxel_batch_init(struct taxel_batch *batch, uint8_t directions);

/* Decode into the output's arrays, from their start. Returns the bytes processed: fewer than `size` if an array is
 * nearly full. */
size_t taxel_batch_decode(struct taxel_batch *batch, const uint8_t *bytes, size_t size,
                          struct taxel_batch_output *output);
/* The stream has ended: decode the remaining bytes. Returns false, and does nothing, if the arrays may be too small. */
bool taxel_batch_finish(struct taxel_batch *batch, struct taxel_batch_output *output);
/* To be called when the host restarts a stopped stream: frames of the interrupted poll cycle then do not count as
 * missing. */
void taxel_batch_forget_cycles(struct taxel_batch *batch);
const struct taxel_batch_totals *taxel_batch_totals(const struct taxel_batch *batch);
uint64_t taxel_batch_discarded_bytes(const struct taxel_batch *batch);

/* Write the payload of an ACKNOWLEDGE frame with the pending acknowledgements, at most `capacity` bytes; returns its
 * length, 0 if none are pending. The acknowledgements written count as sent. */
size_t taxel_batch_take_acknowledgements(struct taxel_batch *batch, uint8_t *payload, size_t capacity);

/* Encode one frame into `out`; returns its bytes on the wire, or 0 if `capacity` is too small. */
size_t taxel_batch_encode(uint8_t type, uint16_t sequence, const uint8_t *payload, uint16_t length, uint8_t *out,
                          size_t capacity);

#endif
