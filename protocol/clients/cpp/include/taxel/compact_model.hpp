/* Prediction of the count of a taxel: the model of the compact coding (SPEC.md, "Coding of compact snapshots").
 * Integers and rounding are part of the protocol. */
#ifndef TAXEL_CLIENT_COMPACT_MODEL_HPP
#define TAXEL_CLIENT_COMPACT_MODEL_HPP

#include "taxel/protocol.hpp"

namespace taxel
{
namespace detail
{

constexpr std::uint32_t COUNT_MAX = 0xFFFF;
constexpr std::uint32_t CUMULATIVE_END = COMPACT_CUMULATIVE[COMPACT_REACH >> COMPACT_STEP_BITS];
constexpr std::uint32_t MIDDLE = COMPACT_ESCAPE + CUMULATIVE_END;
constexpr std::uint32_t UPDATES_MAX = sizeof COMPACT_GAINS / sizeof COMPACT_GAINS[0];

/* State of one taxel. mean: predicted count in 64ths; level: logarithm of the expected spread. */
struct Taxel {
    std::uint32_t mean = 0;
    std::uint32_t level = 0;

    /* Returns the predicted count. */
    std::uint32_t centre() const
    {
        const std::uint32_t rounded = (mean + 32) >> COMPACT_FRACTION_BITS;
        return rounded < COUNT_MAX ? rounded : COUNT_MAX;
    }
    /* Returns the octave of the scale; eight steps follow in each octave. */
    std::uint32_t octave() const
    {
        return level >> 6;
    }
    /* Returns the factor of the scale's step within its octave. */
    std::uint32_t multiplier() const
    {
        return COMPACT_MULTIPLIERS[level >> 3 & 7u];
    }
    /* Returns the number of low bits of a count that are sent uncoded. */
    std::uint32_t raw_bits() const
    {
        return octave() > COMPACT_COARSE_OCTAVE ? octave() - COMPACT_COARSE_OCTAVE : 0;
    }
    /* Converts a magnitude in 64ths of a count to 1024ths of the scale. */
    std::uint32_t distance(std::uint32_t difference) const
    {
        return difference * multiplier() >> octave();
    }
    /* Returns the probability of all counts below `symbol` (a count without its raw bits) and of the escape, in 2^-16.
     */
    std::uint32_t cumulative(std::uint32_t symbol) const
    {
        const std::uint32_t edge = symbol << (raw_bits() + COMPACT_FRACTION_BITS), from = mean + 32;
        const bool is_below = edge < from;
        const std::uint32_t size = distance(is_below ? from - edge : edge - from);
        std::uint32_t share = CUMULATIVE_END;
        if (size < COMPACT_REACH) {
            const std::uint16_t *corner = &COMPACT_CUMULATIVE[size >> COMPACT_STEP_BITS];
            const std::uint32_t fraction = size & ((1u << COMPACT_STEP_BITS) - 1u);
            share = corner[0] + (static_cast<std::uint32_t>(corner[1] - corner[0]) * fraction >> COMPACT_STEP_BITS);
        }
        return is_below ? MIDDLE - share : MIDDLE + share;
    }
};

/* Computes, for each share >> 7, a corner of the cumulative table at which the search for the share starts. */
constexpr std::array<std::uint8_t, 257> make_corner_starts()
{
    std::array<std::uint8_t, 257> starts{};
    std::size_t corner = 0;
    for (std::size_t step = 0; step < starts.size(); step++) {
        while (COMPACT_CUMULATIVE[corner + 1] <= step << 7 && corner < 63) {
            corner++;
        }
        starts[step] = static_cast<std::uint8_t>(corner);
    }
    return starts;
}

inline constexpr auto corner_starts = make_corner_starts();

/* Returns the largest corner of the cumulative table with at most this share. */
inline std::uint32_t find_corner(std::uint32_t share)
{
    std::uint32_t corner = corner_starts[share >> 7];
    while (corner < 63 && COMPACT_CUMULATIVE[corner + 1] <= share) {
        corner++;
    }
    return corner;
}

/* Returns a symbol at or below the symbol of the probability `target`, at most a few symbols away: the end of the
 * table's segment that contains the target. */
inline std::uint32_t find_first_symbol(const Taxel &taxel, std::uint32_t target)
{
    const std::uint32_t shift = taxel.raw_bits() + COMPACT_FRACTION_BITS, from = taxel.mean + 32;
    if (target >= MIDDLE) {
        const std::uint32_t corner = find_corner(target - MIDDLE);
        const std::uint32_t edge = from + (corner << (COMPACT_STEP_BITS + taxel.octave())) / taxel.multiplier();
        const std::uint32_t symbol = edge >> shift, last = COUNT_MAX >> taxel.raw_bits();
        return symbol < last ? symbol : last;
    }
    const std::uint32_t corner = find_corner(MIDDLE - target - 1) + 1; /* first corner with at least this share */
    const std::uint32_t scaled = corner << (COMPACT_STEP_BITS + taxel.octave());
    const std::uint32_t reach = (scaled + taxel.multiplier() - 1) / taxel.multiplier();
    const std::uint32_t symbol = from > reach ? (from - reach) >> shift : 0, last = COUNT_MAX >> taxel.raw_bits();
    return symbol < last ? symbol : last;
}

/* Rounds the difference between count and centre as a board stores it in one byte: exact below 64, else the middle of
 * its quarter of an octave. */
inline std::uint32_t quantise(std::uint32_t size)
{
    if (size < 64) {
        return size;
    }
    std::uint32_t shift = 0;
    while (size >> shift >= 8) {
        shift++;
    }
    return ((size >> shift) << shift) + (1u << shift >> 1);
}

/* Returns a value moved down or up, limited to 0 to `largest`. */
inline std::uint32_t move_limited(std::uint32_t value, bool is_down, std::uint32_t step, std::uint32_t largest)
{
    if (is_down) {
        return value > step ? value - step : 0;
    }
    return step < largest - value ? value + step : largest;
}

/* Returns the state after one more key frame. gain: weight of the new count, in 256ths. */
inline Taxel update(const Taxel &taxel, std::uint32_t count, std::uint32_t gain)
{
    const std::int64_t centre = taxel.centre();
    const std::int64_t residual = static_cast<std::int64_t>(count) - centre;
    const std::int64_t size = quantise(static_cast<std::uint32_t>(residual < 0 ? -residual : residual));
    const std::int64_t difference = 64 * (centre + (residual < 0 ? -size : size)) - taxel.mean;
    const bool is_down = difference < 0;
    const std::uint32_t magnitude = static_cast<std::uint32_t>(is_down ? -difference : difference);
    const std::uint32_t scales = taxel.distance(magnitude);
    Taxel next = taxel;
    if (scales >= COMPACT_JUMP) {
        next.mean = move_limited(taxel.mean, is_down, magnitude, COMPACT_MEAN_MAX);
        return next;
    }
    const std::uint32_t clipped = scales < COMPACT_CLIP ? scales : COMPACT_CLIP;
    const std::uint32_t spread = clipped * COMPACT_MEAN_DEVIATION >> 10;
    const bool is_smaller = spread < COMPACT_UNIT;
    const std::uint32_t excess = is_smaller ? COMPACT_UNIT - spread : spread - COMPACT_UNIT;
    const std::uint32_t step = (excess * gain * COMPACT_LEVEL_STEP + (1u << 17)) >> 18;
    next.level = move_limited(taxel.level, is_smaller, step, COMPACT_LEVEL_MAX);
    next.mean = move_limited(taxel.mean, is_down, (magnitude * gain + 128) >> 8, COMPACT_MEAN_MAX);
    return next;
}

} // namespace detail
} // namespace taxel

#endif
