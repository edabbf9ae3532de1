#include "codec/encoder.h"

#include "codec/crc32.h"
#include "generated/taxel_protocol.h"

size_t taxel_encoded_size_max(size_t payload_length)
{
    const size_t body = TAXEL_FRAME_HEADER_SIZE + payload_length + TAXEL_FRAME_CRC_SIZE;
    return body + body / 254u + 1u + 2u;
}

static void emit(struct taxel_encoder *encoder, uint8_t byte)
{
    encoder->ring[encoder->position] = byte;
    encoder->position = encoder->position + 1u == encoder->capacity ? 0u : encoder->position + 1u;
    encoder->written++;
}

static void open_block(struct taxel_encoder *encoder)
{
    encoder->code_position = encoder->position;
    encoder->code = 1;
    emit(encoder, 0);
}

static void stuff(struct taxel_encoder *encoder, uint8_t byte)
{
    /* A full block is closed only when more follows, so that a frame never ends with an empty block. */
    if (encoder->code == 0xFFu) {
        encoder->ring[encoder->code_position] = encoder->code;
        open_block(encoder);
    }
    if (byte == 0) {
        encoder->ring[encoder->code_position] = encoder->code;
        open_block(encoder);
        return;
    }
    emit(encoder, byte);
    encoder->code++;
}

static void put_body(struct taxel_encoder *encoder, const uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        stuff(encoder, (uint8_t)(bytes[i] ^ encoder->whitening));
        encoder->whitening = (uint8_t)(TAXEL_WHITENING_FACTOR * encoder->whitening + TAXEL_WHITENING_INCREMENT);
    }
}

void taxel_encoder_begin(struct taxel_encoder *encoder, uint8_t *ring, size_t capacity, size_t position, uint8_t type,
                         uint16_t sequence, uint16_t payload_length)
{
    uint8_t header[TAXEL_FRAME_HEADER_SIZE];
    encoder->ring = ring;
    encoder->capacity = capacity;
    encoder->position = position;
    encoder->written = 0;
    encoder->crc = 0;
    encoder->whitening = (uint8_t)TAXEL_WHITENING_SEED;
    header[0] = type;
    taxel_put_u16(header + 1, sequence);
    taxel_put_u16(header + 3, payload_length);
    emit(encoder, 0);
    open_block(encoder);
    taxel_encoder_put(encoder, header, sizeof header);
}

void taxel_encoder_put(struct taxel_encoder *encoder, const uint8_t *bytes, size_t size)
{
    encoder->crc = taxel_crc32(encoder->crc, bytes, size);
    put_body(encoder, bytes, size);
}

size_t taxel_encoder_end(struct taxel_encoder *encoder)
{
    uint8_t crc[TAXEL_FRAME_CRC_SIZE];
    taxel_put_u32(crc, encoder->crc);
    put_body(encoder, crc, sizeof crc);
    encoder->ring[encoder->code_position] = encoder->code;
    emit(encoder, 0);
    return encoder->written;
}
