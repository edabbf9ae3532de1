/* The two implementations of taxel_crc32() on a PC: sixteen tables, or the carry-less multiplication of x86-64.
 * Included by crc32_fast.c, crc32_clmul.c and their test; other code calls taxel_crc32(). */
#ifndef TAXEL_CRC32_VARIANTS_H
#define TAXEL_CRC32_VARIANTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define TAXEL_CRC32_CLMUL_MIN 32u

uint32_t taxel_crc32_sliced(uint32_t crc, const uint8_t *bytes, size_t size);

/* For at least TAXEL_CRC32_CLMUL_MIN bytes, and only if taxel_crc32_has_clmul(). */
uint32_t taxel_crc32_clmul(uint32_t crc, const uint8_t *bytes, size_t size);
bool taxel_crc32_has_clmul(void);

#endif
