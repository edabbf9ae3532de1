/* Prediction of a taxel's next count, and its update by a key frame. Constants and rounding are part of the
 * protocol: both sides must compute the same state. */
#include "codec/compact.h"

#define COUNT_MAX 0xFFFFu
#define HALF_COUNT (1u << (TAXEL_COMPACT_FRACTION_BITS - 1u))
#define EXACT_RESIDUALS 64u /* smaller residuals are stored exactly */
#define RESIDUAL_NEGATIVE 0x80u

static const uint16_t cumulative[] = TAXEL_COMPACT_CUMULATIVE;
static const uint16_t multipliers[] = TAXEL_COMPACT_MULTIPLIERS;
static const uint8_t gains[] = TAXEL_COMPACT_GAINS;

/* Return the predicted count of a taxel, in units of 1/64 count, from its packed state. */
static uint32_t mean_of(taxel_compact_state state)
{
    return state >> TAXEL_COMPACT_LEVEL_BITS;
}

/* Return the logarithm of the expected spread of a taxel's counts (0 to 1023, 64 steps per factor of two), from the
 * taxel's packed state. */
static uint32_t level_of(taxel_compact_state state)
{
    return state & TAXEL_COMPACT_LEVEL_MAX;
}

/* Return the ratio of a difference (in 1/64 count) to the expected spread of the taxel, in units of 1/1024. The spread
 * is 2^(level / 64): level / 64 gives the shift, and the next three bits of the level select one of eight multipliers
 * (256 / 2^(j / 8)). */
static uint32_t distance(taxel_compact_state state, uint32_t difference)
{
    const uint32_t level = level_of(state);
    return (difference * multipliers[(level >> 3) & 7u]) >> (level >> 6);
}

/* Return the state of a taxel after a packed key frame: the predicted count is the count itself, and the level
 * (logarithm of the expected spread) follows from the start bits of the snapshot's `format` byte. */
taxel_compact_state taxel_compact_initial_state(uint16_t count, uint8_t format)
{
    const uint32_t start = (format & TAXEL_COMPACT_START_MASK) >> TAXEL_COMPACT_START_SHIFT;
    return ((uint32_t)count << (TAXEL_COMPACT_FRACTION_BITS + TAXEL_COMPACT_LEVEL_BITS)) |
           (TAXEL_COMPACT_LEVEL_START + TAXEL_COMPACT_LEVEL_START_STEP * start);
}

/* Return the predicted count of a taxel, rounded to a whole number of counts, at most 65535. */
uint16_t taxel_compact_centre(taxel_compact_state state)
{
    const uint32_t centre = (mean_of(state) + HALF_COUNT) >> TAXEL_COMPACT_FRACTION_BITS;
    return (uint16_t)(centre > COUNT_MAX ? COUNT_MAX : centre);
}

/* Return the number of low bits of a count that are sent uncoded, because the expected spread of the taxel is so large
 * that their values are equally probable. */
uint8_t taxel_compact_raw_bits(taxel_compact_state state)
{
    const uint32_t octave = level_of(state) >> 6;
    return (uint8_t)(octave > TAXEL_COMPACT_COARSE_OCTAVE ? octave - TAXEL_COMPACT_COARSE_OCTAVE : 0u);
}

/* Return the cumulative frequency, out of 2^TAXEL_COMPACT_TOTAL_BITS, of all symbols below `symbol`. A symbol is a
 * count without its uncoded low bits. The distribution is symmetric about the predicted count and scales with the
 * expected spread; a table is interpolated linearly up to TAXEL_COMPACT_REACH (8 spreads). The lowest frequencies
 * belong to the escape, a symbol that precedes a count too far from the prediction. */
uint32_t taxel_compact_cumulative(taxel_compact_state state, uint32_t symbol)
{
    const uint32_t middle = TAXEL_COMPACT_ESCAPE + cumulative[TAXEL_COMPACT_REACH >> TAXEL_COMPACT_STEP_BITS];
    const uint32_t edge = symbol << (taxel_compact_raw_bits(state) + TAXEL_COMPACT_FRACTION_BITS);
    const uint32_t from = mean_of(state) + HALF_COUNT;
    const bool below = edge < from;
    const uint32_t size = distance(state, below ? from - edge : edge - from);
    uint32_t share = cumulative[TAXEL_COMPACT_REACH >> TAXEL_COMPACT_STEP_BITS];
    if (size < TAXEL_COMPACT_REACH) {
        const uint16_t *corner = &cumulative[size >> TAXEL_COMPACT_STEP_BITS];
        const uint32_t fraction = size & ((1u << TAXEL_COMPACT_STEP_BITS) - 1u);
        share = corner[0] + (((uint32_t)(corner[1] - corner[0]) * fraction) >> TAXEL_COMPACT_STEP_BITS);
    }
    return below ? middle - share : middle + share;
}

/* Return the interval of a count in the cumulative distribution, and the number of its low bits that are sent uncoded.
 * The interval is empty for a count too far from the prediction, which is sent as an escape symbol and a difference. */
struct taxel_compact_interval taxel_compact_interval(taxel_compact_state state, uint16_t count)
{
    const uint8_t raw_bits = taxel_compact_raw_bits(state);
    const uint32_t symbol = (uint32_t)count >> raw_bits;
    const uint32_t first = taxel_compact_cumulative(state, symbol);
    return (struct taxel_compact_interval){first, taxel_compact_cumulative(state, symbol + 1u) - first, raw_bits};
}

/* Encode the difference of a count from the predicted count in one byte: sign bit, then exact up to 63 counts, and
 * above that rounded down to quarters of an octave (factor of two). The board stores only this byte per taxel until the
 * host acknowledges the key frame. */
uint8_t taxel_compact_residual(taxel_compact_state state, uint16_t count)
{
    const uint16_t centre = taxel_compact_centre(state);
    const uint8_t sign = count < centre ? RESIDUAL_NEGATIVE : 0u;
    uint32_t size = (uint32_t)(count < centre ? centre - count : count - centre);
    if (size < EXACT_RESIDUALS) {
        return (uint8_t)(sign | size);
    }
    uint8_t code = EXACT_RESIDUALS; /* one code per quarter of an octave, from 64 on */
    while (size >= 2u * EXACT_RESIDUALS) {
        size >>= 1;
        code = (uint8_t)(code + 4u);
    }
    return (uint8_t)(sign | (code + ((size >> 4) & 3u))); /* 64 to 127 now: two bits select the quarter */
}

/* Decode the magnitude of a residual, in counts, from its one-byte code: the middle of the range that the code
 * represents. The first code above the exact ones represents 64 to 79 counts (middle 72); each of the four ranges of an
 * octave is 16 counts wide there, and doubles with each octave. */
static uint32_t size_of(uint8_t residual)
{
    const uint32_t code = residual & ~RESIDUAL_NEGATIVE;
    if (code < EXACT_RESIDUALS) {
        return code;
    }
    return (72u + 16u * (code & 3u)) << ((code - EXACT_RESIDUALS) >> 2);
}

/* Return `value` moved down or up by `by`, clipped to 0 ... `largest`. */
static uint32_t shifted(uint32_t value, bool down, uint32_t by, uint32_t largest)
{
    if (down) {
        return value > by ? value - by : 0u;
    }
    return by < largest - value ? value + by : largest;
}

/* Return the state of a taxel after one more key frame. The predicted count and the level (logarithm of the expected
 * spread) move towards the residual by a gain that decreases with the number of `updates`. A residual of
 * TAXEL_COMPACT_JUMP (6 spreads) or more, such as the onset of a contact, replaces the predicted count and keeps the
 * level. The additions of 128 and 2^17 round the results of the shifts by 8 and 18 bits. */
taxel_compact_state taxel_compact_update(taxel_compact_state state, uint8_t residual, uint8_t updates)
{
    const uint32_t gain = gains[updates - 1u], mean = mean_of(state);
    const uint32_t from = ((uint32_t)taxel_compact_centre(state)) << TAXEL_COMPACT_FRACTION_BITS;
    const uint32_t by = size_of(residual) << TAXEL_COMPACT_FRACTION_BITS;
    /* The quantised count may lie below 0 or above the largest count: the difference wraps, and its top bit is the
     * sign. */
    const uint32_t difference = (residual & RESIDUAL_NEGATIVE ? from - by : from + by) - mean;
    const bool down = difference >> 31;
    const uint32_t size = down ? 0u - difference : difference;
    const uint32_t scales = distance(state, size);
    uint32_t level = level_of(state);
    if (scales >= TAXEL_COMPACT_JUMP) {
        return (shifted(mean, down, size, TAXEL_COMPACT_MEAN_MAX) << TAXEL_COMPACT_LEVEL_BITS) | level;
    }
    const uint32_t clipped = scales < TAXEL_COMPACT_CLIP ? scales : TAXEL_COMPACT_CLIP;
    const uint32_t spread = (clipped * TAXEL_COMPACT_MEAN_DEVIATION) >> 10;
    const bool smaller = spread < TAXEL_COMPACT_UNIT;
    const uint32_t excess = smaller ? TAXEL_COMPACT_UNIT - spread : spread - TAXEL_COMPACT_UNIT;
    level =
        shifted(level, smaller, (excess * gain * TAXEL_COMPACT_LEVEL_STEP + (1u << 17)) >> 18, TAXEL_COMPACT_LEVEL_MAX);
    return (shifted(mean, down, (size * gain + 128u) >> 8, TAXEL_COMPACT_MEAN_MAX) << TAXEL_COMPACT_LEVEL_BITS) | level;
}
