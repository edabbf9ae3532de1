/* Encoding of frames for the wire: header, payload in pieces, CRC-32, whitening, byte stuffing and delimiters in one
 * pass.
 *
 * Integration (`wire` has at least taxel_encoded_size_max(payload_size) bytes):
 *
 *     struct taxel_encoder encoder;
 *     taxel_encoder_begin(&encoder, wire, sizeof wire, 0, TAXEL_FRAME_TYPE_HOST_HANDSHAKE, sequence, payload_size);
 *     taxel_encoder_put(&encoder, payload, payload_size);  // any number of pieces
 *     size = taxel_encoder_end(&encoder);
 *     send(wire, size);
 *
 * firmware/tests/test_integration_examples.c compiles and runs this example. */
#ifndef TAXEL_ENCODER_H
#define TAXEL_ENCODER_H

#include <stddef.h>
#include <stdint.h>

/* Writes into a ring of any size (a linear buffer is a ring that does not wrap). The members belong to the encoder. */
struct taxel_encoder {
    uint8_t *ring, *limit; /* first byte of the ring, and the address behind its last byte */
    uint8_t *start, *at;   /* first byte of the frame, and the next byte to write */
    uint8_t *code_at;      /* code byte of the open COBS block */
    uint32_t crc;
    uint8_t code;
    uint8_t whitening;
};

/* Return the largest number of bytes on the wire for a payload of this length, delimiters included. */
size_t taxel_encoded_size_max(size_t payload_length);

/* Begin a frame at ring[position]. The ring must have space for taxel_encoded_size_max(payload_length) bytes. */
void taxel_encoder_begin(struct taxel_encoder *encoder, uint8_t *ring, size_t capacity, size_t position, uint8_t type,
                         uint16_t sequence, uint16_t payload_length);
void taxel_encoder_put(struct taxel_encoder *encoder, const uint8_t *bytes, size_t size);

/* Finish the frame; returns its number of bytes on the wire, delimiters included. */
size_t taxel_encoder_end(struct taxel_encoder *encoder);

/* Return the position in the ring at which the next byte will be written. */
size_t taxel_encoder_position(const struct taxel_encoder *encoder);

#endif
