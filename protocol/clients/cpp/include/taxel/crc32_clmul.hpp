/* CRC-32 by carry-less multiplication on x86-64: V. Gopal et al., "Fast CRC Computation for Generic Polynomials Using
 * PCLMULQDQ Instruction", Intel, 2009. Included by crc32.hpp. */
#ifndef TAXEL_CLIENT_CRC32_CLMUL_HPP
#define TAXEL_CLIENT_CRC32_CLMUL_HPP

#include <cstddef>
#include <cstdint>
#include <immintrin.h>

#define TAXEL_CLMUL __attribute__((target("pclmul,sse4.1"), always_inline)) inline

namespace taxel
{
namespace detail
{

constexpr std::size_t CLMUL_MIN = 32;
constexpr std::size_t CLMUL_BLOCK = 16;

/* Pairs of x^n modulo the generator, 32 bits reflected and shifted by one: over four blocks n = 544 and 480, over one
 * block n = 160 and 96, and n = 64; then the generator with the quotient of x^64, 33 bits reflected. */
struct ClmulPair {
    long long high, low;
};
constexpr ClmulPair FOLD_FOUR = {0x1C6E41596, 0x154442BD4}, FOLD_ONE = {0x0CCAA009E, 0x1751997D0},
                    FOLD_HALF = {0, 0x163CD6124}, REDUCE = {0x1F7011641, 0x1DB710641};

/* Returns whether the processor has the instructions. */
inline bool has_clmul()
{
    return __builtin_cpu_supports("pclmul") && __builtin_cpu_supports("sse4.1");
}

/* Loads a pair of constants. */
TAXEL_CLMUL __m128i clmul_pair(const ClmulPair &pair)
{
    return _mm_set_epi64x(pair.high, pair.low);
}

/* Loads a block. */
TAXEL_CLMUL __m128i clmul_load(const std::uint8_t *bytes)
{
    return _mm_loadu_si128(reinterpret_cast<const __m128i *>(bytes));
}

/* Moves the remainder over the distance of the constants, and adds the block there. */
TAXEL_CLMUL __m128i clmul_fold(__m128i remainder, const ClmulPair &pair, __m128i block)
{
    const __m128i constants = clmul_pair(pair);
    const __m128i low = _mm_clmulepi64_si128(remainder, constants, 0x00);
    return _mm_xor_si128(_mm_xor_si128(low, _mm_clmulepi64_si128(remainder, constants, 0x11)), block);
}

/* Computes the CRC register from a remainder of 128 bits: a fold to 64 bits, then the reduction by Barrett. */
TAXEL_CLMUL std::uint32_t clmul_reduce(__m128i remainder)
{
    const __m128i lower = _mm_set_epi32(0, -1, 0, -1);
    const __m128i last = clmul_pair(REDUCE);
    __m128i x =
        _mm_xor_si128(_mm_srli_si128(remainder, 8), _mm_clmulepi64_si128(remainder, clmul_pair(FOLD_ONE), 0x10));
    x = _mm_xor_si128(_mm_srli_si128(x, 4), _mm_clmulepi64_si128(_mm_and_si128(x, lower), clmul_pair(FOLD_HALF), 0x00));
    const __m128i quotient = _mm_and_si128(_mm_clmulepi64_si128(_mm_and_si128(x, lower), last, 0x10), lower);
    return static_cast<std::uint32_t>(
        _mm_extract_epi32(_mm_xor_si128(x, _mm_clmulepi64_si128(quotient, last, 0x00)), 1));
}

/* Moves the bytes of a vector up by n positions (down for a negative n); zeros take the free positions. */
TAXEL_CLMUL __m128i clmul_shift(__m128i vector, int n)
{
    const __m128i indices = _mm_set_epi8(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m128i from = _mm_sub_epi8(indices, _mm_set1_epi8(static_cast<char>(n)));
    return _mm_shuffle_epi8(vector, _mm_or_si128(from, _mm_cmpgt_epi8(from, _mm_set1_epi8(15))));
}

/* Computes the CRC-32 of at least CLMUL_MIN bytes. The first block holds the bytes beyond whole blocks at its upper
 * end: zeros before the message have no effect. The register is added to the first four bytes, which may extend into
 * the next block. */
__attribute__((target("pclmul,sse4.1"))) inline std::uint32_t crc32_clmul(std::uint32_t crc, const std::uint8_t *bytes,
                                                                          std::size_t size)
{
    const std::size_t odd = size % CLMUL_BLOCK;
    const __m128i state = _mm_cvtsi32_si128(static_cast<int>(~crc));
    __m128i block = clmul_load(bytes), carried = state;
    if (odd) {
        block = clmul_shift(_mm_xor_si128(block, state), static_cast<int>(CLMUL_BLOCK - odd));
        carried = clmul_shift(state, -static_cast<int>(odd));
        bytes += odd;
        size -= odd;
        block = clmul_fold(block, FOLD_ONE, clmul_load(bytes));
    }
    block = _mm_xor_si128(block, carried);
    bytes += CLMUL_BLOCK;
    size -= CLMUL_BLOCK;
    if (size >= 7 * CLMUL_BLOCK) { /* four independent remainders, because a multiplication takes several cycles */
        __m128i b = clmul_load(bytes), c = clmul_load(bytes + 16), d = clmul_load(bytes + 32);
        bytes += 3 * CLMUL_BLOCK;
        size -= 3 * CLMUL_BLOCK;
        for (; size >= 4 * CLMUL_BLOCK; size -= 4 * CLMUL_BLOCK, bytes += 4 * CLMUL_BLOCK) {
            block = clmul_fold(block, FOLD_FOUR, clmul_load(bytes));
            b = clmul_fold(b, FOLD_FOUR, clmul_load(bytes + 16));
            c = clmul_fold(c, FOLD_FOUR, clmul_load(bytes + 32));
            d = clmul_fold(d, FOLD_FOUR, clmul_load(bytes + 48));
        }
        block = clmul_fold(clmul_fold(clmul_fold(block, FOLD_ONE, b), FOLD_ONE, c), FOLD_ONE, d);
    }
    for (; size; size -= CLMUL_BLOCK, bytes += CLMUL_BLOCK) {
        block = clmul_fold(block, FOLD_ONE, clmul_load(bytes));
    }
    return ~clmul_reduce(block);
}

} // namespace detail
} // namespace taxel

#undef TAXEL_CLMUL

#endif
