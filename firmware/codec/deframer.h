/* Extraction of frames from a byte stream. A chunk between two zeros that is not exactly one frame is searched at every
 * byte, so that no valid frame is lost because of a damaged neighbour. A complete frame whose type or length this
 * version does not define is skipped and counted. Allocates no memory, and uses no length before it has checked it.
 *
 * Integration:
 *
 *     static uint8_t chunk[2u * (TAXEL_ENCODED_MAX + 2u)], body[TAXEL_BODY_MAX];
 *     static const struct taxel_deframer_config config = {
 *         .chunk = chunk, .chunk_capacity = sizeof chunk, .body = body, .payload_max = TAXEL_PAYLOAD_MAX,
 *         .directions = TAXEL_DIRECTION_TO_HOST, .handler = on_frame, .context = NULL,
 *     };
 *     static struct taxel_deframer deframer;
 *     taxel_deframer_init(&deframer, &config);
 *     taxel_deframer_push(&deframer, bytes, size);  // for each piece of the stream; calls on_frame() for each frame
 *     taxel_deframer_finish(&deframer);             // at the end of the stream
 *
 * firmware/tests/test_integration_examples.c compiles and runs this example. */
#ifndef TAXEL_DEFRAMER_H
#define TAXEL_DEFRAMER_H

#include <stddef.h>
#include <stdint.h>

struct taxel_frame {
    const uint8_t *payload; /* valid only during the handler's call */
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
    /* Buffer for the bytes of an incomplete chunk. Size in bytes: at least twice
     * taxel_encoded_size_max(payload_max). */
    uint8_t *chunk;
    size_t chunk_capacity;

    /* Buffer for one unstuffed frame: payload_max + 9 bytes (header and CRC). */
    uint8_t *body;

    /* Longest accepted payload in bytes, 0 to TAXEL_PAYLOAD_MAX (498). */
    uint16_t payload_max;

    /* Accepted frame types: a bitwise OR of enum taxel_direction, 1 to 3. */
    uint8_t directions;

    /* Called for each frame, with `context`, which may be NULL. */
    taxel_frame_handler handler;
    void *context;

    /* Called for each complete frame that this version does not define, with `context`. NULL: such frames are only
     * counted. */
    taxel_frame_handler unknown_handler;
};

struct taxel_deframer {
    struct taxel_deframer_config config;
    size_t fill;              /* bytes in the chunk buffer */
    uint64_t position;        /* bytes of the stream processed so far */
    uint64_t discarded_bytes; /* bytes that belong to no frame; delimiters do not count */
    uint64_t frames;
    uint64_t unknown_frames; /* complete frames with an undefined type or length, or of a direction not accepted */
};

void taxel_deframer_init(struct taxel_deframer *deframer, const struct taxel_deframer_config *config);
void taxel_deframer_push(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size);

/* Push at most up to and including the next zero; returns the bytes processed, so that a caller can stop between
 * frames. */
size_t taxel_deframer_push_chunk(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size);

/* Search the buffered bytes for frames after the end of the stream. */
void taxel_deframer_finish(struct taxel_deframer *deframer);

#endif
