/* The two ways in which a PC computes taxel_crc32(): sixteen tables, or the carry-less multiplication of x86-64. */
#ifndef TAXEL_CRC32_WAYS_H
#define TAXEL_CRC32_WAYS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define TAXEL_CRC32_CLMUL_MIN 32u

uint32_t taxel_crc32_sliced(uint32_t crc, const uint8_t *bytes, size_t size);

/* Of at least TAXEL_CRC32_CLMUL_MIN bytes, and only where taxel_crc32_has_clmul(). */
uint32_t taxel_crc32_clmul(uint32_t crc, const uint8_t *bytes, size_t size);
bool taxel_crc32_has_clmul(void);

#endif
