#include "codec/encoder.h"

#include <stdbool.h>

#include "codec/crc32.h"
#include "generated/taxel_protocol.h"

/* Return the largest encoded size in bytes of a frame with this payload length: body, one COBS code byte per 254 bytes
 * of the body or part of them, two delimiters. */
size_t taxel_encoded_size_max(size_t payload_length)
{
    const size_t body = TAXEL_FRAME_HEADER_SIZE + payload_length + TAXEL_FRAME_CRC_SIZE;
    /* body / 254, exact up to 16,000; a division would take 270 bytes of flash on a Cortex-M0 */
    const size_t full_blocks = (body * 16514u) >> 22;
    return body + full_blocks + 1u + 2u;
}

#define FULL_BLOCK 0xFFu

/* Return the position after `at` in the ring buffer of the encoder; the position after the last byte is the first
 * byte. */
static uint8_t *position_after(const struct taxel_encoder *encoder, uint8_t *at)
{
    return at + 1 == encoder->limit ? encoder->ring : at + 1;
}

/* Begin a COBS block: reserve the byte `at` for the code of the block, which is written when the block is closed.
 * Returns the position after it. */
static uint8_t *open_block(struct taxel_encoder *encoder, uint8_t *at)
{
    encoder->code_at = at;
    return position_after(encoder, at);
}

/* Write one byte at the current position of the ring buffer and advance the position. */
static void put(struct taxel_encoder *encoder, uint8_t byte)
{
    *encoder->at = byte;
    encoder->at = position_after(encoder, encoder->at);
}

/* Append bytes to the body of the frame: whitening, then byte stuffing (COBS). Values that change with every byte
 * are kept in registers: memory accesses are slow on a Cortex-M0. */
static void put_body(struct taxel_encoder *encoder, const uint8_t *bytes, size_t size)
{
    uint8_t *at = encoder->at;
    uint8_t *const limit = encoder->limit;
    uint32_t whitening = encoder->whitening, code = encoder->code;
    for (const uint8_t *const end = bytes + size; bytes != end;) {
        const uint8_t byte = (uint8_t)(*bytes ^ whitening);
        /* A full block is closed only when more follows, so that a frame never ends with an empty block. */
        if (code == FULL_BLOCK || byte == 0) {
            *encoder->code_at = (uint8_t)code;
            at = open_block(encoder, at);
            const bool is_full = code == FULL_BLOCK;
            code = 1;
            if (is_full) {
                continue; /* the current byte is not encoded yet, and may be a zero */
            }
        } else {
            *at++ = byte;
            at = at == limit ? encoder->ring : at;
            code++;
        }
        bytes++;
        whitening = TAXEL_WHITENING_FACTOR * whitening + TAXEL_WHITENING_INCREMENT; /* only the low byte is used */
    }
    encoder->at = at;
    encoder->whitening = (uint8_t)whitening;
    encoder->code = (uint8_t)code;
}

/* Begin a frame at `position` of a ring of `capacity` bytes: delimiter, then the header as the first encoded bytes.
 * `payload_length` bytes must follow with taxel_encoder_put(). */
void taxel_encoder_begin(struct taxel_encoder *encoder, uint8_t *ring, size_t capacity, size_t position, uint8_t type,
                         uint16_t sequence, uint16_t payload_length)
{
    uint8_t header[TAXEL_FRAME_HEADER_SIZE];
    encoder->ring = ring;
    encoder->limit = ring + capacity;
    encoder->at = encoder->start = ring + position;
    encoder->crc = 0;
    encoder->code = 1;
    encoder->whitening = (uint8_t)TAXEL_WHITENING_SEED;
    header[0] = type;
    taxel_put_u16(header + 1, sequence);
    taxel_put_u16(header + 3, payload_length);
    put(encoder, 0);
    encoder->at = open_block(encoder, encoder->at);
    taxel_encoder_put(encoder, header, sizeof header);
}

/* Encode the next bytes of the payload and include them in the CRC. */
void taxel_encoder_put(struct taxel_encoder *encoder, const uint8_t *bytes, size_t size)
{
    if (size) { /* `bytes` may be NULL for an empty piece */
        encoder->crc = taxel_crc32(encoder->crc, bytes, size);
        put_body(encoder, bytes, size);
    }
}

/* End a frame with its CRC-32 and a delimiter. Returns the encoded length in bytes, both delimiters included. */
size_t taxel_encoder_end(struct taxel_encoder *encoder)
{
    uint8_t crc[TAXEL_FRAME_CRC_SIZE];
    taxel_put_u32(crc, encoder->crc);
    put_body(encoder, crc, sizeof crc);
    *encoder->code_at = encoder->code;
    put(encoder, 0);
    const ptrdiff_t written = encoder->at - encoder->start;
    return (size_t)(written > 0 ? written : written + (encoder->limit - encoder->ring));
}

/* Return the index in the ring buffer at which the encoder writes its next byte. */
size_t taxel_encoder_position(const struct taxel_encoder *encoder)
{
    return (size_t)(encoder->at - encoder->ring);
}
