#include "bootloader/internal.h"
#include "codec/crc32.h"

#define VECTORS_SIZE 8u /* stack pointer and reset vector at least */
#define LENGTH_MIN (TAXEL_BOOT_IMAGE_HEADER_SIZE + VECTORS_SIZE)

/* Return whether an image of this `kind` (design of the board) may run on this board. An image of kind 0 fits every
 * board, and a board of kind 0 or without a configuration accepts every image. */
static bool kind_fits(const struct taxel_boot_flash *flash, uint8_t kind)
{
    const uint8_t *const configuration = taxel_boot_configuration(flash);
    const uint8_t own = configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] : 0;
    return kind == 0 || own == 0 || kind == own;
}

/* Return the first byte of the image in a slot (0 is A, 1 is B), or NULL if the image is invalid or there is no such
 * slot. An image is invalid if its header is for another device, slot or kind of board, if its length or the address of
 * its vector table is outside the slot or no multiple of 4, or if its CRC-32 is wrong. */
const uint8_t *taxel_boot_image(const struct taxel_boot_flash *flash, uint8_t slot)
{
    if (slot >= TAXEL_BOOT_SLOTS) {
        return NULL;
    }
    const uint32_t address = (uint32_t)flash->layout->first_rows[slot] * TAXEL_BOOT_ROW_SIZE;
    const uint8_t *const bytes = flash->hal->flash + address;
    const uint32_t length = taxel_boot_u32(bytes + TAXEL_BOOT_IMAGE_HEADER_OFFSET_LENGTH);
    const uint32_t vectors = taxel_boot_u32(bytes + TAXEL_BOOT_IMAGE_HEADER_OFFSET_VECTORS) - address;
    if (taxel_boot_u32(bytes) != TAXEL_BOOT_IMAGE_MAGIC ||
        bytes[TAXEL_BOOT_IMAGE_HEADER_OFFSET_HEADER_VERSION] != TAXEL_BOOT_VERSION ||
        bytes[TAXEL_BOOT_IMAGE_HEADER_OFFSET_DEVICE] != flash->layout->device ||
        bytes[TAXEL_BOOT_IMAGE_HEADER_OFFSET_SLOT] != slot ||
        !kind_fits(flash, bytes[TAXEL_BOOT_IMAGE_HEADER_OFFSET_KIND]) || ((length | vectors) & 3u) ||
        length > (uint32_t)flash->layout->slot_rows * TAXEL_BOOT_ROW_SIZE || length < LENGTH_MIN ||
        vectors < TAXEL_BOOT_IMAGE_HEADER_SIZE || vectors > length - VECTORS_SIZE) {
        return NULL;
    }
    const uint32_t crc = taxel_crc32(taxel_crc32(0, bytes, TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32),
                                     bytes + TAXEL_BOOT_IMAGE_HEADER_SIZE, length - TAXEL_BOOT_IMAGE_HEADER_SIZE);
    return crc == taxel_boot_u32(bytes + TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32) ? bytes : NULL;
}
