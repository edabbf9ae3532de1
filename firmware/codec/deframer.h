/* Frames out of a byte stream. A chunk between two zeros that is not one whole frame is searched at every byte, so that no
 * valid frame is lost to a broken neighbour. Never allocates; never trusts a length before it has checked it. */
#ifndef TAXEL_DEFRAMER_H
#define TAXEL_DEFRAMER_H

#include <stddef.h>
#include <stdint.h>

struct taxel_frame {
    const uint8_t *payload; /* valid during the handler only */
    uint16_t length;
    uint16_t sequence;
    uint8_t type;
};

typedef void (*taxel_frame_handler)(void *context, const struct taxel_frame *frame);

enum taxel_direction {
    TAXEL_DIRECTION_TO_HOST = 1,
    TAXEL_DIRECTION_TO_HUB = 2,
};

struct taxel_deframer_config {
    uint8_t *chunk; /* chunk_capacity bytes, at least twice taxel_encoded_size_max(payload_max) */
    size_t chunk_capacity;
    uint8_t *body; /* 9 + payload_max bytes */
    uint16_t payload_max;
    uint8_t directions; /* which frame types are believed: TAXEL_DIRECTION_... */
    taxel_frame_handler handler;
    void *context;
};

struct taxel_deframer {
    struct taxel_deframer_config config;
    size_t fill;
    uint64_t position;        /* bytes of the stream taken so far */
    uint64_t discarded_bytes; /* bytes that belong to no frame; delimiters do not count */
    uint64_t frames;
};

void taxel_deframer_init(struct taxel_deframer *deframer, const struct taxel_deframer_config *config);
void taxel_deframer_push(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size);

/* Push at most up to and including the next zero; returns the bytes taken, so that a caller can stop between frames. */
size_t taxel_deframer_push_chunk(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size);

/* The stream has ended: search what is left. */
void taxel_deframer_finish(struct taxel_deframer *deframer);

#endif
