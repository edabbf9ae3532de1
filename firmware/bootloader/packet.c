#include "bootloader/internal.h"

/* Compute the checksum of `size` bytes of a packet, which is sent least significant byte first. `checksum` selects the
 * kind: 16-bit two's complement of the sum of all bytes (TAXEL_BOOT_CHECKSUM_SUM), or CRC-16/X-25 with swapped
 * bytes. */
uint16_t taxel_boot_packet_checksum(const uint8_t *bytes, size_t size, uint8_t checksum)
{
    if (checksum == TAXEL_BOOT_CHECKSUM_SUM) {
        unsigned sum = 0;
        for (size_t i = 0; i < size; i++) {
            sum += bytes[i];
        }
        return (uint16_t)(0u - sum);
    }
    unsigned crc = 0xFFFFu; /* CRC-16/X-25, its bytes swapped */
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (unsigned bit = 0; bit < 8; bit++) {
            crc = (crc >> 1) ^ ((crc & 1u) ? 0x8408u : 0u); /* polynomial 0x1021 with its bits in reverse order */
        }
    }
    crc ^= 0xFFFFu;
    return (uint16_t)((crc << 8) | (crc >> 8));
}

/* Parse a received packet. `packet->data` points into `bytes`. `checksum`: kind of the checksum
 * (TAXEL_BOOT_CHECKSUM_...). Returns TAXEL_BOOT_STATUS_OK or the status that the response must contain. */
uint8_t taxel_boot_packet_parse(struct taxel_boot_packet *packet, const uint8_t *bytes, size_t size, uint8_t checksum)
{
    if (size < TAXEL_BOOT_PACKET_OVERHEAD || size > TAXEL_BOOT_PACKET_MAX ||
        taxel_get_u16(bytes + 2) != size - TAXEL_BOOT_PACKET_OVERHEAD) {
        return TAXEL_BOOT_STATUS_LENGTH;
    }
    const size_t end = size - 3u; /* before checksum (2 bytes) and end byte */
    if (bytes[0] != TAXEL_BOOT_PACKET_START || bytes[end + 2u] != TAXEL_BOOT_PACKET_END) {
        return TAXEL_BOOT_STATUS_DATA;
    }
    if (taxel_get_u16(bytes + end) != taxel_boot_packet_checksum(bytes, end, checksum)) {
        return TAXEL_BOOT_STATUS_CHECKSUM;
    }
    packet->command = bytes[1];
    packet->length = (uint8_t)(end - TAXEL_BOOT_DATA_OFFSET);
    packet->data = bytes + TAXEL_BOOT_DATA_OFFSET;
    return TAXEL_BOOT_STATUS_OK;
}

/* Complete a response packet, whose `length` data bytes are already at bytes + TAXEL_BOOT_DATA_OFFSET, with start byte,
 * status, length, checksum and end byte. `checksum`: kind of the checksum (TAXEL_BOOT_CHECKSUM_...). Returns the size
 * of the packet in bytes. */
size_t taxel_boot_packet_build(uint8_t *bytes, uint8_t status, uint8_t length, uint8_t checksum)
{
    const size_t end = TAXEL_BOOT_DATA_OFFSET + (size_t)length;
    bytes[0] = TAXEL_BOOT_PACKET_START;
    bytes[1] = status;
    taxel_put_u16(bytes + 2, length);
    taxel_put_u16(bytes + end, taxel_boot_packet_checksum(bytes, end, checksum));
    bytes[end + 2u] = TAXEL_BOOT_PACKET_END;
    return end + 3u;
}
