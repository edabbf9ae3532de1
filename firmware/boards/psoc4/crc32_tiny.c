/* CRC-32 as in codec/crc32_small.c, but two bits at a time: the table has a quarter of the size, and the
 * computation takes twice as long (20 ms for a slot). For the bootloader, which must fit into 4 KiB. */
#include "codec/crc32.h"

/* Remainders of the 2-bit values 0 to 3 for the reflected polynomial 0xEDB88320. */
static const uint32_t table[4] = {0x00000000u, 0x76DC4190u, 0xEDB88320u, 0x9B64C2B0u};

/* Compute the CRC-32 (IEEE 802.3, reflected) of the bytes, two bits per step with a table of four words, because the
 * bootloader has little flash. `crc`: CRC of the preceding bytes, 0 at the start. */
uint32_t taxel_crc32(uint32_t crc, const uint8_t *bytes, size_t size)
{
    crc = ~crc;
    while (size--) {
        crc ^= *bytes++;
        for (unsigned pair = 0; pair < 4u; pair++) {
            crc = (crc >> 2) ^ table[crc & 3u];
        }
    }
    return ~crc;
}
