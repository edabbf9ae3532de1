/* CRC-32 of IEEE 802.3, as crc32() of zlib: tables of constants, and carry-less multiplication on x86-64. */
#ifndef TAXEL_CLIENT_CRC32_HPP
#define TAXEL_CLIENT_CRC32_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "taxel/protocol.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#include "taxel/crc32_clmul.hpp"
#endif

namespace taxel
{

namespace detail
{

constexpr std::size_t CRC_SLICES = 16;
using CrcTables = std::array<std::array<std::uint32_t, 256>, CRC_SLICES>;

/* Computes the tables of the slicing method (Kounavis and Berry, 2005): tables[k][b] is the remainder of byte b and k
 * zero bytes. */
constexpr CrcTables make_crc_tables()
{
    CrcTables tables{};
    for (std::uint32_t byte = 0; byte < 256; byte++) {
        std::uint32_t remainder = byte;
        for (int bit = 0; bit < 8; bit++) {
            remainder = remainder >> 1 ^ (remainder & 1u ? 0xEDB88320u : 0u);
        }
        tables[0][byte] = remainder;
    }
    for (std::size_t slice = 1; slice < CRC_SLICES; slice++) {
        for (std::size_t byte = 0; byte < 256; byte++) {
            const std::uint32_t before = tables[slice - 1][byte];
            tables[slice][byte] = before >> 8 ^ tables[0][before & 0xFFu];
        }
    }
    return tables;
}

inline constexpr CrcTables crc_tables = make_crc_tables();

/* Returns the CRC register after `size` bytes, at most 16, in one step. The register affects the first four bytes. */
inline std::uint32_t advance_crc(std::uint32_t state, const std::uint8_t *bytes, std::size_t size)
{
    if (size < 4) {
        for (std::size_t i = 0; i < size; i++) {
            state = state >> 8 ^ crc_tables[0][(state ^ bytes[i]) & 0xFFu];
        }
        return state;
    }
    std::uint32_t first = 0;
    load(bytes, first);
    first ^= state;
    state = 0;
    for (std::size_t i = 0; i < 4; i++) {
        state ^= crc_tables[size - 1 - i][first >> 8 * i & 0xFFu];
    }
    for (std::size_t i = 4; i < size; i++) {
        state ^= crc_tables[size - 1 - i][bytes[i]];
    }
    return state;
}

/* Computes a CRC-32 with the tables. */
inline std::uint32_t crc32_sliced(std::uint32_t crc, const std::uint8_t *bytes, std::size_t size)
{
    crc = ~crc;
    for (; size > CRC_SLICES; size -= CRC_SLICES, bytes += CRC_SLICES) {
        crc = advance_crc(crc, bytes, CRC_SLICES);
    }
    return ~advance_crc(crc, bytes, size);
}

} // namespace detail

/* Computes the CRC-32 of the bytes. `crc`: CRC-32 of the bytes before them, 0 at the start. */
inline std::uint32_t crc32(const std::uint8_t *bytes, std::size_t size, std::uint32_t crc = 0)
{
#if defined(__x86_64__) && defined(__GNUC__)
    static const bool has_clmul = detail::has_clmul();
    if (has_clmul && size >= detail::CLMUL_MIN) {
        return detail::crc32_clmul(crc, bytes, size);
    }
#endif
    return detail::crc32_sliced(crc, bytes, size);
}

namespace detail
{

/* Advances a CRC register over a fixed number of zero bytes: a linear operation, as one table per byte of the register.
 */
class CrcZeros
{
  public:
    /* Builds the tables for `size` zero bytes. */
    explicit CrcZeros(std::size_t size) : size_(size)
    {
        for (std::size_t byte = 0; byte < 4; byte++) {
            for (std::size_t bit = 0; bit < 8; bit++) {
                const std::uint32_t column = advance(std::uint32_t{1} << (8 * byte + bit));
                for (std::size_t value = 0; value < std::size_t{1} << bit; value++) {
                    tables_[byte][(std::size_t{1} << bit) + value] = tables_[byte][value] ^ column;
                }
            }
        }
    }
    /* Returns the number of zero bytes. */
    std::size_t size() const
    {
        return size_;
    }
    /* Returns the register after the zero bytes, with the tables. */
    std::uint32_t operator()(std::uint32_t state) const
    {
        return tables_[0][state & 0xFFu] ^ tables_[1][state >> 8 & 0xFFu] ^ tables_[2][state >> 16 & 0xFFu] ^
               tables_[3][state >> 24];
    }

  private:
    /* Returns the register after the zero bytes, without the tables. */
    std::uint32_t advance(std::uint32_t state) const
    {
        const std::uint8_t zeros[64] = {};
        std::uint32_t crc = ~state; /* crc32() inverts its argument and its result */
        for (std::size_t left = size_; left;) {
            const std::size_t step = left < sizeof zeros ? left : sizeof zeros;
            crc = crc32(zeros, step, crc);
            left -= step;
        }
        return ~crc;
    }

    std::size_t size_;
    std::uint32_t tables_[4][256] = {};
};

} // namespace detail

} // namespace taxel

#endif
