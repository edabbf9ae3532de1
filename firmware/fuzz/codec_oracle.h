/* Expected output of a receiver for a complete stream: an independent, slow implementation of SPEC.md, "Receiver"
 * and "Counting losses", without limited buffers and without state between pieces. The fuzz target compares the
 * decoders with it. */
#ifndef TAXEL_CODEC_ORACLE_H
#define TAXEL_CODEC_ORACLE_H

#include "codec/batch.h"

#define ORACLE_STREAM_MAX 1536u                          /* one and a half times a receiver's buffer */
#define ORACLE_FRAMES_MAX (ORACLE_STREAM_MAX / 10u + 1u) /* an unknown frame has 10 stuffed bytes or more */

struct oracle_frame {
    uint8_t type;
    uint16_t sequence, length;
    size_t offset;           /* of its payload in `payloads` */
    uint16_t lost_before;    /* frames of the hub lost before this frame */
    uint16_t missing_before; /* poll cycles without a frame of this board before this frame */
    uint8_t flags;           /* enum taxel_batch_flag */
    bool is_unknown;         /* type, length or address is not defined in this protocol version */
    bool is_of_other_direction;
};

struct oracle {
    struct oracle_frame frames[ORACLE_FRAMES_MAX];
    size_t frame_count;
    uint8_t payloads[ORACLE_STREAM_MAX];
    size_t payload_size;
    uint64_t discarded_bytes;
    bool has_compact; /* a compact snapshot whose board CRC is valid */
    struct taxel_batch_totals totals;
};

/* Return whether the frame type permits a payload of `length` bytes and is sent in one of `directions`. */
bool oracle_allows(uint8_t type, uint8_t directions, size_t length);

/* Decode every frame of the stream, in order, and count the losses between them. */
void oracle_decode(struct oracle *oracle, const uint8_t *bytes, size_t size, uint8_t directions);

#endif
