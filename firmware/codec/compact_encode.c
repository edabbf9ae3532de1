/* Encoding of compact snapshots on the board: counts to bytes, with a 32-bit range coder (Martin, 1979) without
 * division. Carries propagate into the bytes already written. */
#include "codec/compact.h"

#define TOP 0x1000000u /* the range never stays below this value */
#define EXPONENT_BITS 4u

struct range_encoder {
    uint8_t *bytes;
    size_t size;
    size_t capacity;
    uint32_t low;   /* lower end of the present interval */
    uint32_t range; /* width of the present interval */
};

/* Propagate a carry of the range encoder: add 1 to the long number that the bytes already written form. */
static void carry(struct range_encoder *encoder)
{
    for (size_t i = encoder->size; i > 0; i--) {
        encoder->bytes[i - 1u]++;
        if (encoder->bytes[i - 1u] != 0) {
            break;
        }
    }
}

/* Narrow the encoder's interval to [first, first + size) of 2^bits equal shares, which encodes one symbol. Then output
 * the highest byte of `low` and widen the interval by 8 bits until its width is at least TOP (2^24), so that a share of
 * the next symbol is never 0. Returns false if the output is full. */
static bool put(struct range_encoder *encoder, uint32_t first, uint32_t size, uint8_t bits)
{
    const uint32_t share = encoder->range >> bits;
    const uint32_t low = encoder->low + first * share;
    if (low < encoder->low) {
        carry(encoder);
    }
    encoder->low = low;
    encoder->range = size * share;
    while (encoder->range < TOP) {
        if (encoder->size == encoder->capacity) {
            return false;
        }
        encoder->bytes[encoder->size++] = (uint8_t)(encoder->low >> 24);
        encoder->low <<= 8;
        encoder->range <<= 8;
    }
    return true;
}

/* Encode a count that is too far from the predicted count for the modelled distribution: sign, exponent and
 * mantissa of its distance from the predicted count (the centre). Returns false if the buffer is full. */
static bool put_escape(struct range_encoder *encoder, taxel_compact_state state, uint16_t count)
{
    const uint16_t centre = taxel_compact_centre(state);
    const bool negative = count < centre;
    const uint32_t size = (uint32_t)(negative ? centre - count : count - centre);
    uint8_t exponent = 0;
    while (size >> (exponent + 1u)) {
        exponent++;
    }
    return put(encoder, 0, TAXEL_COMPACT_ESCAPE, TAXEL_COMPACT_TOTAL_BITS) &&
           put(encoder, 2u * exponent + negative, 1, EXPONENT_BITS + 1u) &&
           put(encoder, size - (1u << exponent), 1, exponent);
}

/* Encode one count with the model `state` of its taxel; low bits that the model treats as uniform follow without
 * modelling. Returns false if the buffer is full. */
static bool put_count(struct range_encoder *encoder, taxel_compact_state state, uint16_t count)
{
    const struct taxel_compact_interval interval = taxel_compact_interval(state, count);
    if (!interval.size) {
        return put_escape(encoder, state, count);
    }
    return put(encoder, interval.first, interval.size, TAXEL_COMPACT_TOTAL_BITS) &&
           (!interval.raw_bits || put(encoder, count & ((1u << interval.raw_bits) - 1u), 1, interval.raw_bits));
}

/* Write the fewest bytes that identify the final interval of the range encoder; a decoder reads zeros behind them.
 * Returns false if the output is full. */
static bool finish(struct range_encoder *encoder)
{
    unsigned kept = 0;
    uint32_t value = 0;
    /* `value`: the smallest number from `low` on that has zeros behind its upper `kept` bytes */
    for (; kept < 4u; kept++) {
        const uint32_t below = kept ? (1u << (32u - 8u * kept)) - 1u : 0xFFFFFFFFu;
        value = (encoder->low + below) & ~below; /* may wrap: then it is a carry and zeros */
        if (value - encoder->low < encoder->range) {
            break;
        }
    }
    if (kept == 4u) {
        value = encoder->low;
    }
    if (value < encoder->low) {
        carry(encoder);
    }
    for (; kept; kept--, value <<= 8) {
        if (encoder->size == encoder->capacity) {
            return false;
        }
        encoder->bytes[encoder->size++] = (uint8_t)(value >> 24);
    }
    while (encoder->size && !encoder->bytes[encoder->size - 1u]) {
        encoder->size--;
    }
    return true;
}

/* Encode counts (2 bytes each, little-endian) as a delta frame. `states` [taxels]: predicted count and expected spread
 * of each taxel at the key frame. Returns false if the code needs more than `capacity` bytes; otherwise `size` is set
 * to the length of the code. */
bool taxel_compact_encode(const taxel_compact_state *states, const uint8_t *counts, size_t taxels, uint8_t *bytes,
                          size_t capacity, size_t *size)
{
    struct range_encoder encoder = {.bytes = bytes, .capacity = capacity, .range = 0xFFFFFFFFu};
    for (size_t i = 0; i < taxels; i++) {
        if (!put_count(&encoder, states[i], taxel_get_u16(counts + 2u * i))) {
            return false;
        }
    }
    if (!finish(&encoder)) {
        return false;
    }
    *size = encoder.size;
    return true;
}

/* Return the number of bits (1 to 16) that the largest count needs; `counts`: 2 bytes each, little-endian. */
uint8_t taxel_compact_width(const uint8_t *counts, size_t taxels)
{
    unsigned all = 1;
    for (size_t i = 0; i < taxels; i++) {
        all |= taxel_get_u16(counts + 2u * i);
    }
    uint8_t width = 0;
    for (; all; all >>= 1) {
        width++;
    }
    return width;
}

/* Return the number of bytes for `taxels` counts of `width` bits each, rounded up. */
size_t taxel_compact_packed_size(uint8_t width, size_t taxels)
{
    return (width * taxels + 7u) >> 3;
}

/* Pack counts (2 bytes each, little-endian) with `width` bits each, least significant bit first. */
void taxel_compact_pack(const uint8_t *counts, size_t taxels, uint8_t width, uint8_t *bytes)
{
    uint32_t buffer = 0;
    uint8_t bits = 0;
    for (size_t i = 0; i < taxels; i++) {
        buffer |= (uint32_t)taxel_get_u16(counts + 2u * i) << bits;
        for (bits = (uint8_t)(bits + width); bits >= 8u; bits = (uint8_t)(bits - 8u)) {
            *bytes++ = (uint8_t)buffer;
            buffer >>= 8;
        }
    }
    if (bits) {
        *bytes = (uint8_t)buffer;
    }
}
