/* Decoding of compact snapshots on the host: bytes to counts. For any bytes, nothing is read beyond their end and every
 * count has 16 bits. */
#include "codec/compact.h"

#define TOP 0x1000000u
#define COUNT_MAX 0xFFFFu
#define EXPONENT_BITS 4u

struct range_decoder {
    const uint8_t *bytes;
    size_t size;
    size_t position; /* of the next byte to shift in; may exceed `size` */
    uint32_t code;   /* position of the code inside the present range */
    uint32_t range;  /* width of the present range */
};

/* Shift the next byte of the code into the range decoder; 0 after the end of the bytes. */
static void shift(struct range_decoder *decoder)
{
    const uint8_t byte = decoder->position < decoder->size ? decoder->bytes[decoder->position] : 0;
    decoder->position++;
    decoder->code = decoder->code << 8 | byte;
}

/* Divide the range decoder's present range into 2^bits equal shares and return the index of the share to which the next
 * symbol belongs. The state of the decoder does not change. */
static uint32_t peek(const struct range_decoder *decoder, uint8_t bits)
{
    const uint32_t target = decoder->code / (decoder->range >> bits), last = (1u << bits) - 1u;
    /* the remainder of the division belongs to no share; only damaged bytes point there */
    return target < last ? target : last;
}

/* Remove a decoded symbol from the range decoder. The interval of the symbol is [first, first + size) of 2^bits
 * equal shares of the range. */
static void take(struct range_decoder *decoder, uint32_t first, uint32_t size, uint8_t bits)
{
    const uint32_t share = decoder->range >> bits;
    decoder->code -= first * share;
    decoder->range = size * share;
    while (decoder->range < TOP) {
        shift(decoder);
        decoder->range <<= 8;
    }
}

/* Decode a number of `bits` bits, all values of which are equally probable. */
static uint32_t take_bits(struct range_decoder *decoder, uint8_t bits)
{
    const uint32_t value = peek(decoder, bits);
    take(decoder, value, 1, bits);
    return value;
}

/* Decode an escape: a count that is too far from the predicted count for the modelled distribution. Its distance
 * from the predicted count (the centre) is coded as exponent (upper bits of `head`), sign (bit 0 of `head`, 1: below
 * the centre) and mantissa: 2^exponent + mantissa counts. Returns false if the count is outside 0 to 65535, which only
 * damaged bytes cause. */
static bool take_escape(struct range_decoder *decoder, taxel_compact_state state, uint16_t *count)
{
    take(decoder, 0, TAXEL_COMPACT_ESCAPE, TAXEL_COMPACT_TOTAL_BITS);
    const uint32_t head = take_bits(decoder, EXPONENT_BITS + 1u);
    const uint8_t exponent = (uint8_t)(head >> 1);
    const uint32_t size = (1u << exponent) + take_bits(decoder, exponent);
    const uint32_t centre = taxel_compact_centre(state);
    if (head & 1u ? size > centre : size > COUNT_MAX - centre) {
        return false;
    }
    *count = (uint16_t)(head & 1u ? centre - size : centre + size);
    return true;
}

/* Decode one count with the model `state` of its taxel: an escape, or the symbol that a bisection of the cumulative
 * distribution finds, followed by the uncoded low bits. Returns false for bytes that no encoder produces. */
static bool take_count(struct range_decoder *decoder, taxel_compact_state state, uint16_t *count)
{
    const uint32_t target = peek(decoder, TAXEL_COMPACT_TOTAL_BITS);
    if (target < TAXEL_COMPACT_ESCAPE) {
        return take_escape(decoder, state, count);
    }
    const uint8_t raw_bits = taxel_compact_raw_bits(state);
    /* Counts to search: the table of the distribution ends at 8 expected spreads from the centre. This is less than
     * 2^(octave + 1) counts; the octave is the level of the state (logarithm of the spread) divided by 64. */
    const uint32_t centre = taxel_compact_centre(state), half = 2u + (2u << ((state & TAXEL_COMPACT_LEVEL_MAX) >> 6));
    uint32_t low = (centre > half ? centre - half : 0u) >> raw_bits;
    uint32_t high = (centre + half < COUNT_MAX ? centre + half : COUNT_MAX) >> raw_bits;
    while (low < high) {
        const uint32_t middle = (low + high + 1u) / 2u;
        if (taxel_compact_cumulative(state, middle) <= target) {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    const uint32_t first = taxel_compact_cumulative(state, low);
    const uint32_t size = taxel_compact_cumulative(state, low + 1u) - first;
    if (target < first || target - first >= size) {
        return false;
    }
    take(decoder, first, size, TAXEL_COMPACT_TOTAL_BITS);
    *count = (uint16_t)(low << raw_bits);
    if (raw_bits) {
        *count = (uint16_t)(*count | take_bits(decoder, raw_bits));
    }
    return true;
}

/* Decode the counts of a delta frame. `states` [taxels]: predicted count and expected spread of each taxel at the key
 * frame. Returns false if no encoder produces these bytes. Bytes beyond `size` read as 0. */
bool taxel_compact_decode(const taxel_compact_state *states, size_t taxels, const uint8_t *bytes, size_t size,
                          uint16_t *counts)
{
    struct range_decoder decoder = {.bytes = bytes, .size = size, .range = 0xFFFFFFFFu};
    for (int i = 0; i < 4; i++) { /* the code has 32 bits */
        shift(&decoder);
    }
    for (size_t i = 0; i < taxels; i++) {
        if (!take_count(&decoder, states[i], &counts[i])) {
            return false;
        }
    }
    return true;
}

/* Unpack `taxels` counts of `width` bits each (1 to 16), least significant bit first. */
void taxel_compact_unpack(const uint8_t *bytes, size_t taxels, uint8_t width, uint16_t *counts)
{
    uint32_t buffer = 0;
    uint8_t bits = 0;
    for (size_t i = 0; i < taxels; i++) {
        for (; bits < width; bits = (uint8_t)(bits + 8u)) {
            buffer |= (uint32_t)*bytes++ << bits;
        }
        counts[i] = (uint16_t)(buffer & ((1u << width) - 1u));
        buffer >>= width;
        bits = (uint8_t)(bits - width);
    }
}
