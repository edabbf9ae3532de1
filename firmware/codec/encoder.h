/* Frames onto a wire: header, payload in pieces, CRC-32, whitening, byte stuffing and delimiters in one pass. */
#ifndef TAXEL_ENCODER_H
#define TAXEL_ENCODER_H

#include <stddef.h>
#include <stdint.h>

/* Writes into a ring of any size (a plain buffer is a ring that does not wrap). Only the encoder touches its members. */
struct taxel_encoder {
    uint8_t *ring, *limit;
    uint8_t *start, *at, *code_at;
    uint32_t crc;
    uint8_t code;
    uint8_t whitening;
};

/* Bytes on the wire of a payload of that length at most, delimiters included. */
size_t taxel_encoded_size_max(size_t payload_length);

/* Begin a frame at ring[position]. The ring must have room for taxel_encoded_size_max(payload_length) bytes. */
void taxel_encoder_begin(struct taxel_encoder *encoder, uint8_t *ring, size_t capacity, size_t position, uint8_t type,
                         uint16_t sequence, uint16_t payload_length);
void taxel_encoder_put(struct taxel_encoder *encoder, const uint8_t *bytes, size_t size);

/* Finish the frame; returns its bytes on the wire. */
size_t taxel_encoder_end(struct taxel_encoder *encoder);

/* Where in the ring the next byte would go. */
size_t taxel_encoder_position(const struct taxel_encoder *encoder);

#endif
