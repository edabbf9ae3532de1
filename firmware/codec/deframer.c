#include "codec/deframer.h"

#include <stdbool.h>

#include "codec/crc32.h"
#include "codec/encoder.h"
#include "codec/whitening.h"
#include "generated/taxel_protocol.h"

/* Permitted payloads of a frame type. */
struct rule {
    uint8_t type;
    uint8_t has_address; /* the payload begins with an I2C address */
    uint16_t minimum;    /* length of the payload in bytes */
    uint16_t maximum;
};

#define RULE(type, has_address, minimum, maximum) {type, has_address, minimum, maximum},
static const struct rule rules[] = {TAXEL_FRAME_RULES(RULE)};
#undef RULE

/* Initialise a deframer, which finds frames in a stream of bytes. `config` is copied; its buffers must stay valid. */
void taxel_deframer_init(struct taxel_deframer *deframer, const struct taxel_deframer_config *config)
{
    deframer->config = *config;
    deframer->fill = 0;
    deframer->position = 0;
    deframer->discarded_bytes = 0;
    deframer->frames = 0;
    deframer->unknown_frames = 0;
}

/* Return the rule of a frame type, or NULL if the type is undefined or belongs to a direction that is not accepted. Bit
 * 7 of the type is set in frames from host to hub. */
static const struct rule *rule_of(const struct taxel_deframer *deframer, uint8_t type)
{
    const uint8_t direction = type & 0x80u ? TAXEL_DIRECTION_TO_HUB : TAXEL_DIRECTION_TO_HOST;
    if (!(deframer->config.directions & direction)) {
        return NULL;
    }
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        if (rules[i].type == type) {
            return &rules[i];
        }
    }
    return NULL;
}

/* Return the length in bytes of the body (header, payload, CRC) that begins with this header, or 0 if the stated
 * payload is longer than the longest accepted one. The frame type is not checked: a newer sender may use types and
 * lengths that this version does not define. */
static size_t expected_length(const struct taxel_deframer *deframer, const uint8_t *header)
{
    const uint16_t length = taxel_get_u16(header + 3);
    if (length > deframer->config.payload_max) {
        return 0;
    }
    return TAXEL_FRAME_HEADER_SIZE + (size_t)length + TAXEL_FRAME_CRC_SIZE;
}

/* Return whether the CRC of an unstuffed body is correct. `size`: bytes of header, payload and CRC. */
static bool is_body_crc_correct(const uint8_t *body, size_t size)
{
    return taxel_crc32(0, body, size - TAXEL_FRAME_CRC_SIZE) == taxel_get_u32(body + size - TAXEL_FRAME_CRC_SIZE);
}

/* Return whether this protocol version defines a complete frame: its type, its length, its I2C address and its number
 * of taxels. */
static bool frame_is_known(const struct taxel_deframer *deframer, const struct taxel_frame *frame)
{
    const uint8_t *payload = frame->payload;
    const struct rule *rule = rule_of(deframer, frame->type);
    if (!rule || frame->length < rule->minimum || frame->length > rule->maximum) {
        return false;
    }
    if (rule->has_address && (payload[0] < TAXEL_ADDRESS_MIN || payload[0] > TAXEL_ADDRESS_MAX)) {
        return false;
    }
    return frame->type != TAXEL_FRAME_TYPE_TAXELS ||
           frame->length == TAXEL_TAXEL_HEADER_SIZE + TAXEL_SNAPSHOT_OVERHEAD + 2u * (size_t)payload[1];
}

/* Count the complete frame in the body buffer and call the handler; a frame that this version does not define has its
 * own counter and handler. `size`: bytes of header, payload and CRC. */
static void deliver(struct taxel_deframer *deframer, size_t size)
{
    const uint8_t *body = deframer->config.body;
    const struct taxel_frame frame = {
        .payload = body + TAXEL_FRAME_HEADER_SIZE,
        .length = (uint16_t)(size - TAXEL_FRAME_HEADER_SIZE - TAXEL_FRAME_CRC_SIZE),
        .sequence = taxel_get_u16(body + 1),
        .type = body[0],
    };
    if (frame_is_known(deframer, &frame)) {
        deframer->frames++;
        deframer->config.handler(deframer->config.context, &frame);
        return;
    }
    deframer->unknown_frames++;
    if (deframer->config.unknown_handler) {
        deframer->config.unknown_handler(deframer->config.context, &frame);
    }
}

/* Decode and deliver the frame at the start of `bytes`; returns the number of its stuffed bytes, 0 if no complete frame
 * with a correct CRC begins there. A frame ends with the COBS block at which the unstuffed length equals the length
 * stated in the header: no delimiter is needed. */
static size_t take_frame(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size)
{
    uint8_t *body = deframer->config.body;
    const size_t capacity = TAXEL_FRAME_HEADER_SIZE + (size_t)deframer->config.payload_max + TAXEL_FRAME_CRC_SIZE;
    size_t length = 0;
    size_t expected = 0;
    size_t position = 0;
    while (position < size) {
        const uint8_t code = bytes[position];
        const size_t end = position + code;
        if (end > size || length + code - 1u > capacity) {
            return 0;
        }
        taxel_whiten(body + length, bytes + position + 1, length, code - 1u);
        length += code - 1u;
        position = end;
        if (!expected && length >= TAXEL_FRAME_HEADER_SIZE) {
            expected = expected_length(deframer, body);
            if (!expected) {
                return 0;
            }
        }
        if (expected && length >= expected) {
            if (length > expected || !is_body_crc_correct(body, length)) {
                return 0;
            }
            deliver(deframer, length);
            return position;
        }
        if (code != 0xFFu) { /* COBS: every block stands for a zero after its bytes, except a block of full length */
            if (length == capacity) {
                return 0;
            }
            body[length] = 0;
            taxel_whiten(body + length, body + length, length, 1);
            length++;
        }
    }
    return 0;
}

/* Try every byte before position `until` as the start of a frame, deliver the frames found, and count all other bytes
 * as discarded. Returns the position behind the last byte used, which may exceed `until`. */
static size_t search(struct taxel_deframer *deframer, const uint8_t *chunk, size_t size, size_t until)
{
    size_t start = 0;
    while (start < until) {
        const size_t used = take_frame(deframer, chunk + start, size - start);
        if (!used) {
            deframer->discarded_bytes++;
        }
        start += used ? used : 1u;
    }
    return start;
}

/* Make space in the full chunk buffer, which contains no delimiter: search all but the last bytes for frames, and keep
 * the last bytes, at which an incomplete frame may begin. */
static void make_space(struct taxel_deframer *deframer)
{
    const size_t keep = taxel_encoded_size_max(deframer->config.payload_max);
    const size_t used = search(deframer, deframer->config.chunk, deframer->fill, deframer->fill - keep);
    deframer->fill -= used;
    memmove(deframer->config.chunk, deframer->config.chunk + used, deframer->fill);
}

/* Append bytes without a delimiter to the chunk buffer. A full buffer is searched for frames first, so that any amount
 * of input is accepted. */
static void append(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size)
{
    while (size) {
        if (deframer->fill == deframer->config.chunk_capacity) {
            make_space(deframer);
        }
        const size_t space = deframer->config.chunk_capacity - deframer->fill;
        const size_t step = size < space ? size : space;
        memcpy(deframer->config.chunk + deframer->fill, bytes, step);
        deframer->fill += step;
        bytes += step;
        size -= step;
    }
}

/* Search the bytes of the stream that are still buffered for frames, as if the stream ended here with a delimiter. */
void taxel_deframer_finish(struct taxel_deframer *deframer)
{
    (void)search(deframer, deframer->config.chunk, deframer->fill, deframer->fill);
    deframer->fill = 0;
}

/* Take bytes up to the first delimiter (0), or all if there is none; returns their number. Frames that a delimiter
 * completes are delivered. */
size_t taxel_deframer_push_chunk(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size)
{
    const uint8_t *zero = memchr(bytes, 0, size);
    const size_t length = zero ? (size_t)(zero - bytes) : size;
    const size_t used = zero ? length + 1u : size;
    deframer->position += used;
    if (zero && !deframer->fill && length <= deframer->config.chunk_capacity) {
        (void)search(deframer, bytes, length, length); /* the chunk is complete: no copy is needed */
        return used;
    }
    append(deframer, bytes, length);
    if (zero) {
        taxel_deframer_finish(deframer);
    }
    return used;
}

/* Take any number of stream bytes; each complete frame is passed to the handler. */
void taxel_deframer_push(struct taxel_deframer *deframer, const uint8_t *bytes, size_t size)
{
    while (size) {
        const size_t used = taxel_deframer_push_chunk(deframer, bytes, size);
        bytes += used;
        size -= used;
    }
}
