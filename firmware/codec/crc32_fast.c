#include "codec/crc32.h"

#include "codec/crc32_variants.h"

#define SLICES 16u

/* Slicing (Kounavis and Berry, 2005), sixteen bytes per step: tables[k][b] is byte b followed by k zero bytes. */
static uint32_t tables[SLICES][256];
static bool has_clmul;

/* Compute the look-up tables of the CRC-32 when the library is loaded: a check at each call would be slow, because
 * many calls add only two bytes. */
__attribute__((constructor)) static void fill_tables(void)
{
    has_clmul = taxel_crc32_has_clmul();
    for (uint32_t b = 0; b < 256; b++) {
        uint32_t crc = b;
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc >> 1) ^ ((crc & 1u) ? 0xEDB88320u : 0u);
        }
        tables[0][b] = crc;
    }
    for (uint32_t b = 0; b < 256; b++) {
        for (unsigned k = 1; k < SLICES; k++) {
            tables[k][b] = (tables[k - 1][b] >> 8) ^ tables[0][tables[k - 1][b] & 0xFFu];
        }
    }
}

/* Read a little-endian 32-bit number from 4 bytes. */
static uint32_t little_endian_u32(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

/* Compute the CRC-32 with 16 look-up tables, 16 bytes per step, for processors without carry-less multiplication and
 * for short messages. `crc`: CRC of the preceding bytes, 0 at the start. */
uint32_t taxel_crc32_sliced(uint32_t crc, const uint8_t *bytes, size_t size)
{
    crc = ~crc;
    while (size >= SLICES) {
        const uint32_t first = little_endian_u32(bytes) ^ crc;
        crc = 0;
        for (unsigned i = 0; i < 4; i++) {
            crc ^= tables[15 - i][(first >> (8 * i)) & 0xFFu];
        }
        for (unsigned i = 4; i < SLICES; i++) {
            crc ^= tables[15 - i][bytes[i]];
        }
        bytes += SLICES;
        size -= SLICES;
    }
    if (size >= 4) { /* fewer bytes than a step: again all at once instead of one after the other */
        const uint32_t first = little_endian_u32(bytes) ^ crc;
        crc = 0;
        for (size_t i = 0; i < 4; i++) {
            crc ^= tables[size - 1u - i][(first >> (8u * i)) & 0xFFu];
        }
        for (size_t i = 4; i < size; i++) {
            crc ^= tables[size - 1u - i][bytes[i]];
        }
        return ~crc;
    }
    while (size--) {
        crc = (crc >> 8) ^ tables[0][(crc ^ *bytes++) & 0xFFu];
    }
    return ~crc;
}

/* Compute the CRC-32 (the one of zlib) with the fastest method for this processor and size. `crc`: CRC of the preceding
 * bytes, 0 at the start. */
uint32_t taxel_crc32(uint32_t crc, const uint8_t *bytes, size_t size)
{
    return has_clmul && size >= TAXEL_CRC32_CLMUL_MIN ? taxel_crc32_clmul(crc, bytes, size)
                                                      : taxel_crc32_sliced(crc, bytes, size);
}
