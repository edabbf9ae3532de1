/* CRC-32 of IEEE 802.3 (reflected polynomial 0xEDB88320, initial and final value inverted), as zlib's crc32(). */
#ifndef TAXEL_CRC32_H
#define TAXEL_CRC32_H

#include <stddef.h>
#include <stdint.h>

/* Continue `crc` (0 to begin) over `size` bytes. crc32_small.c: 64 bytes of table; crc32_fast.c: 8 KiB, for PCs. */
uint32_t taxel_crc32(uint32_t crc, const uint8_t *bytes, size_t size);

#endif
