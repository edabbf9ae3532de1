/* CRC-32 by carry-less multiplication on x86-64: V. Gopal et al., "Fast CRC Computation for Generic Polynomials
 * Using PCLMULQDQ Instruction", Intel, 2009. Remainders are folded 16 bytes at a time, then reduced once. */
#include "codec/crc32_variants.h"

#if defined(__x86_64__) && defined(__GNUC__)

#include <immintrin.h>

#define STREAMS 4u
#define BLOCK 16u
#define CLMUL __attribute__((target("pclmul,sse4.1"), always_inline)) static inline

/* x^n modulo the generator, 32 bits reflected and shifted by one: n = 544 and 480 over four blocks, 160 and 96 over
 * one, 64; then the quotient of x^64 and the generator itself, 33 bits reflected. */
#define FOLD_FOUR _mm_set_epi64x(0x1C6E41596, 0x154442BD4)
#define FOLD_ONE _mm_set_epi64x(0x0CCAA009E, 0x1751997D0)
#define FOLD_HALF _mm_set_epi64x(0, 0x163CD6124)
#define REDUCE _mm_set_epi64x(0x1F7011641, 0x1DB710641)

/* Return whether this processor has the carry-less multiplication (PCLMULQDQ) and SSE 4.1, which taxel_crc32_clmul()
 * needs. */
bool taxel_crc32_has_clmul(void)
{
    return __builtin_cpu_supports("pclmul") && __builtin_cpu_supports("sse4.1");
}

/* Load 16 bytes from any address into a vector register. */
CLMUL __m128i load(const uint8_t *bytes)
{
    return _mm_loadu_si128((const __m128i *)(const void *)bytes);
}

/* Advance the remainder of a message by the distance for which `constants` (x^n modulo the polynomial) are computed,
 * and add the block at this position. */
CLMUL __m128i fold(__m128i remainder, __m128i constants, __m128i block)
{
    const __m128i low = _mm_clmulepi64_si128(remainder, constants, 0x00);
    const __m128i high = _mm_clmulepi64_si128(remainder, constants, 0x11);
    return _mm_xor_si128(_mm_xor_si128(low, high), block);
}

/* Reduce a 128-bit remainder to the 32-bit CRC register: folding to 64 bits, then Barrett reduction. */
CLMUL uint32_t reduce(__m128i remainder)
{
    const __m128i lower = _mm_set_epi32(0, -1, 0, -1);
    __m128i x = _mm_xor_si128(_mm_srli_si128(remainder, 8), _mm_clmulepi64_si128(remainder, FOLD_ONE, 0x10));
    x = _mm_xor_si128(_mm_srli_si128(x, 4), _mm_clmulepi64_si128(_mm_and_si128(x, lower), FOLD_HALF, 0x00));
    const __m128i quotient = _mm_and_si128(_mm_clmulepi64_si128(_mm_and_si128(x, lower), REDUCE, 0x10), lower);
    return (uint32_t)_mm_extract_epi32(_mm_xor_si128(x, _mm_clmulepi64_si128(quotient, REDUCE, 0x00)), 1);
}

/* Shift the bytes of a vector up by n positions (negative: down), with zeros shifted in. */
CLMUL __m128i shifted(__m128i vector, int n)
{
    const __m128i indices = _mm_set_epi8(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m128i from = _mm_sub_epi8(indices, _mm_set1_epi8((char)n));
    /* negative indices already have their highest bit set */
    const __m128i outside = _mm_cmpgt_epi8(from, _mm_set1_epi8(15));
    return _mm_shuffle_epi8(vector, _mm_or_si128(from, outside));
}

/* Compute the CRC-32 of at least TAXEL_CRC32_CLMUL_MIN bytes by carry-less multiplication (x86 PCLMULQDQ): blocks of 16
 * bytes are folded, in four independent streams for long messages. `crc`: CRC of the preceding bytes, 0 at the
 * start. */
__attribute__((target("pclmul,sse4.1"))) uint32_t taxel_crc32_clmul(uint32_t crc, const uint8_t *bytes, size_t size)
{
    /* The first block holds the bytes beyond whole blocks at its upper end; zeros before them have no effect. The
     * register is added to the first four bytes of the message, which may extend into the next block. */
    const size_t odd = size % BLOCK;
    const __m128i state = _mm_cvtsi32_si128((int)~crc);
    __m128i block = load(bytes), carried = state;
    if (odd) {
        block = shifted(_mm_xor_si128(block, state), (int)(BLOCK - odd));
        carried = shifted(state, -(int)odd);
        bytes += odd;
        size -= odd;
        block = fold(block, FOLD_ONE, load(bytes));
    }
    block = _mm_xor_si128(block, carried);
    bytes += BLOCK;
    size -= BLOCK;
    if (size >= (2u * STREAMS - 1u) * BLOCK) {
        __m128i streams[STREAMS] = {block, load(bytes), load(bytes + BLOCK), load(bytes + 2u * BLOCK)};
        bytes += (STREAMS - 1u) * BLOCK;
        size -= (STREAMS - 1u) * BLOCK;
        while (size >= STREAMS * BLOCK) {
            for (size_t i = 0; i < STREAMS; i++) {
                streams[i] = fold(streams[i], FOLD_FOUR, load(bytes + i * BLOCK));
            }
            bytes += STREAMS * BLOCK;
            size -= STREAMS * BLOCK;
        }
        block = fold(fold(fold(streams[0], FOLD_ONE, streams[1]), FOLD_ONE, streams[2]), FOLD_ONE, streams[3]);
    }
    for (; size; size -= BLOCK, bytes += BLOCK) {
        block = fold(block, FOLD_ONE, load(bytes));
    }
    return ~reduce(block);
}

#else

/* Version for compilers or processors without carry-less multiplication: always false. */
bool taxel_crc32_has_clmul(void)
{
    return false;
}

/* Version for compilers or processors without carry-less multiplication: never called. */
uint32_t taxel_crc32_clmul(uint32_t crc, const uint8_t *bytes, size_t size)
{
    (void)bytes;
    (void)size;
    return crc;
}

#endif
