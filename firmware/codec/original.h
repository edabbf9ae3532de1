/* Extraction of messages from the byte stream of the original hub (protocol/SPEC.md, part 7). Start and end values also
 * occur in data, so candidates may overlap: the decoder accepts those that no better candidate overlaps. Its result
 * depends only on the bytes of the stream, not on the pieces in which they arrive. Allocates no memory.
 *
 * Integration:
 *
 *     static uint8_t buffer[TAXEL_ORIGINAL_BUFFER_MIN];
 *     static const struct taxel_original_config config = {
 *         .buffer = buffer, .capacity = sizeof buffer, .format = &taxel_format_original,
 *         .handler = on_message, .context = NULL,
 *     };
 *     static struct taxel_original_decoder decoder;
 *     int err = taxel_original_init(&decoder, &config);
 *     taxel_original_push(&decoder, bytes, size);  // for each piece of the stream; calls on_message()
 *     taxel_original_finish(&decoder);             // at the end of the stream
 *
 * firmware/tests/test_integration_examples.c compiles and runs this example. */
#ifndef TAXEL_CODEC_ORIGINAL_H
#define TAXEL_CODEC_ORIGINAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_original.h"

/* Smallest buffer in bytes: two overlapping messages of 255 bytes share at least one byte, and a header of 3 bytes
 * follows the second. */
#define TAXEL_ORIGINAL_BUFFER_MIN 512u

/* One variant of the original hub's messages. */
struct taxel_original_format {
    uint8_t taxels[TAXEL_ORIGINAL_ADDRESSES];        /* by I2C address; 0: no such board */
    uint8_t accelerations[TAXEL_ORIGINAL_ADDRESSES]; /* numbers after the counts, by I2C address: 0 or 3 */
    bool has_timestamp;
    bool is_big_endian;  /* counts are sent high byte first */
    uint8_t record_size; /* length in bytes of a record without any frame; 0: messages are framed */
};

#define TAXEL_ORIGINAL_DECLARE(name, ...) extern const struct taxel_original_format taxel_format_##name;
TAXEL_ORIGINAL_FORMATS(TAXEL_ORIGINAL_DECLARE)
#undef TAXEL_ORIGINAL_DECLARE

struct taxel_original_message {
    const uint8_t *words; /* counts, then accelerations, as sent; valid only during the handler's call */
    uint64_t position;    /* of the message's first byte in the stream */
    uint32_t timestamp_ms;
    uint8_t address;
    uint8_t taxel_count;
    uint8_t acceleration_count;
    bool is_big_endian;
    bool is_time_plausible; /* the time follows one of the last four messages by at most a minute, or the hub started
                               less than a minute ago; false without timestamps */
};

typedef void (*taxel_original_handler)(void *context, const struct taxel_original_message *message);

struct taxel_original_config {
    /* Buffer for the bytes of undecided candidates. Size in bytes: at least TAXEL_ORIGINAL_BUFFER_MIN. */
    uint8_t *buffer;
    size_t capacity;

    const struct taxel_original_format *format;

    /* Called for each message, with `context`, which may be NULL. */
    taxel_original_handler handler;
    void *context;
};

/* A complete candidate: positions in the buffer of its first byte and behind its last byte. */
struct taxel_original_candidate {
    size_t start, end;
    bool is_known;     /* whether has_evidence has been determined */
    bool has_evidence; /* its time is plausible; without timestamps: a header or the end of the stream follows it */
};

struct taxel_original_decoder {
    struct taxel_original_config config;
    size_t fill;                             /* bytes in the buffer */
    size_t scan;                             /* first byte that is not searched yet */
    size_t strong_end;                       /* end of the farthest candidate with evidence */
    struct taxel_original_candidate current; /* best candidate that overlaps the byte at `scan` */
    bool has_current;
    uint8_t time_count, time_next;
    uint32_t times[TAXEL_ORIGINAL_REFERENCE_TIMES]; /* timestamps of the last messages */
    uint64_t base;                                  /* stream position of the buffer's first byte */
    uint64_t covered;                               /* stream position up to which bytes are accepted or discarded */
    uint64_t messages;
    uint64_t discarded_bytes;      /* bytes in no message */
    uint64_t rejected_candidates;  /* headers without an end byte at their length */
    uint64_t ambiguous_candidates; /* complete candidates that overlap a better one */
};

/* Returns 0, or -1 for a buffer that is too small or a board whose message would exceed 255 bytes. */
int taxel_original_init(struct taxel_original_decoder *decoder, const struct taxel_original_config *config);
void taxel_original_push(struct taxel_original_decoder *decoder, const uint8_t *bytes, size_t size);

/* To be called at the end of the stream or in a pause of the hub: incomplete candidates are rejected. Later bytes begin
 * a new stream with the same counters and reference times. */
void taxel_original_finish(struct taxel_original_decoder *decoder);

/* Return the length in bytes of a complete message of this board; 0: the format has no such board. */
size_t taxel_original_length(const struct taxel_original_format *format, uint8_t address);

/* Return word number `index` of a message; the accelerations follow the counts. */
uint16_t taxel_original_word(const struct taxel_original_message *message, size_t index);

#endif
