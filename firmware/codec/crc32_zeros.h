/* Effect of `size` zero bytes on a CRC-32 register. A CRC is linear, so the CRC of a part of a message follows from
 * the CRC of the message and this effect, without reading the part again.
 *
 * Integration: the registers of two messages that differ only in their first bytes, after a common tail of `size`
 * bytes, differ by
 *
 *     taxel_crc32_zeros_init(&zeros, size);
 *     difference_after = taxel_crc32_zeros_after(&zeros, difference_before);
 */
#ifndef TAXEL_CRC32_ZEROS_H
#define TAXEL_CRC32_ZEROS_H

#include <stddef.h>
#include <stdint.h>

struct taxel_crc32_zeros {
    size_t size;
    uint32_t table[4][256]; /* for each byte of the register and each of its values: the effect on the register */
};

/* Fill the table for any `size`. Takes some microseconds. */
void taxel_crc32_zeros_init(struct taxel_crc32_zeros *zeros, size_t size);

/* Return the content of the CRC register after the zero bytes, if it contained `state` before them. */
static inline uint32_t taxel_crc32_zeros_after(const struct taxel_crc32_zeros *zeros, uint32_t state)
{
    return zeros->table[0][state & 0xFFu] ^ zeros->table[1][(state >> 8) & 0xFFu] ^
           zeros->table[2][(state >> 16) & 0xFFu] ^ zeros->table[3][state >> 24];
}

#endif
