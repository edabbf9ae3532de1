/* What `size` bytes of zero do to a CRC-32's register. A CRC is linear: from it, and the CRC of a message, follows that of a part of
 * the message without reading that part again. */
#ifndef TAXEL_CRC32_ZEROS_H
#define TAXEL_CRC32_ZEROS_H

#include <stddef.h>
#include <stdint.h>

struct taxel_crc32_zeros {
    size_t size;
    uint32_t table[4][256]; /* of each byte of the register */
};

/* `size` of any length. Takes some microseconds. */
void taxel_crc32_zeros_init(struct taxel_crc32_zeros *zeros, size_t size);

static inline uint32_t taxel_crc32_zeros_after(const struct taxel_crc32_zeros *zeros, uint32_t state)
{
    return zeros->table[0][state & 0xFFu] ^ zeros->table[1][(state >> 8) & 0xFFu] ^ zeros->table[2][(state >> 16) & 0xFFu] ^
           zeros->table[3][state >> 24];
}

#endif
