#include "codec/crc32_zeros.h"

#include "codec/crc32.h"

#define BLOCK 64u

/* Return the content of the CRC register after `size` zero bytes, if it contained `state` before them. */
static uint32_t advance_over_zeros(uint32_t state, size_t size)
{
    static const uint8_t zeros[BLOCK];
    uint32_t crc = ~state; /* taxel_crc32() inverts its argument and its result */
    for (; size > BLOCK; size -= BLOCK) {
        crc = taxel_crc32(crc, zeros, BLOCK);
    }
    return ~taxel_crc32(crc, zeros, size);
}

/* Build the tables that advance a CRC register over `size` zero bytes. The operation is linear over GF(2): one column
 * per bit of the register, combined to a table per byte. */
void taxel_crc32_zeros_init(struct taxel_crc32_zeros *zeros, size_t size)
{
    zeros->size = size;
    for (unsigned byte = 0; byte < 4; byte++) {
        uint32_t *const table = zeros->table[byte];
        table[0] = 0;
        for (unsigned bit = 0; bit < 8; bit++) {
            const uint32_t column = advance_over_zeros(1u << (8u * byte + bit), size);
            for (unsigned value = 0; value < 1u << bit; value++) {
                table[(1u << bit) + value] = table[value] ^ column;
            }
        }
    }
}
