/* CRC-32 of IEEE 802.3 (reflected polynomial 0xEDB88320, initial and final value inverted), as zlib's crc32().
 *
 * Integration (link exactly one of crc32_small.c and crc32_fast.c):
 *
 *     uint32_t crc = taxel_crc32(0, &address, 1);  // begin
 *     crc = taxel_crc32(crc, bytes, size);         // continue
 */
#ifndef TAXEL_CRC32_H
#define TAXEL_CRC32_H

#include <stddef.h>
#include <stdint.h>

/* Continue `crc` (0 to begin) over `size` bytes. crc32_small.c: 64 bytes of table; crc32_fast.c: tables of 16 KiB,
 * for PCs. */
uint32_t taxel_crc32(uint32_t crc, const uint8_t *bytes, size_t size);

#endif
