/* Commands that report on the flash, the images and the board. */
#include "bootloader/internal.h"

/* Execute the command GET_FLASH_SIZE: reply with the numbers of the first and the last flash row of the free slot, the
 * only slot that the host may program. Returns status ARRAY for a flash array other than 0, otherwise OK. */
uint8_t taxel_boot_get_flash_size(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const struct taxel_boot_layout *const layout = boot->config->flash.layout;
    const unsigned first = layout->first_rows[taxel_boot_target(boot)];
    taxel_put_u16(reply, (uint16_t)first);
    taxel_put_u16(reply + TAXEL_BOOT_FLASH_SIZE_REPLY_OFFSET_LAST_ROW, (uint16_t)(first + layout->slot_rows - 1u));
    return packet->data[0] ? TAXEL_BOOT_STATUS_ARRAY : TAXEL_BOOT_STATUS_OK;
}

/* Execute the command GET_APPLICATION_STATUS: reply with 1 if the image in a slot is invalid (0 if it is valid), then 1
 * if this slot must be kept because it contains the image to fall back to. Returns status APPLICATION if there is no
 * such slot. */
uint8_t taxel_boot_get_application_status(struct taxel_boot *boot, const struct taxel_boot_packet *packet,
                                          uint8_t *reply)
{
    const uint8_t slot = packet->data[0];
    if (slot >= TAXEL_BOOT_SLOTS) {
        return TAXEL_BOOT_STATUS_APPLICATION;
    }
    reply[0] = taxel_boot_image(&boot->config->flash, slot) == NULL;
    reply[1] = slot == boot->kept_slot;
    return TAXEL_BOOT_STATUS_OK;
}

/* Execute the command GET_METADATA: reply with entry address, length, version and kind of the image in a slot, in the
 * layout of the manufacturer's bootloader, whose field for a custom id contains the CRC-32 of the image. Returns status
 * APPLICATION if the slot contains no valid image. */
uint8_t taxel_boot_get_metadata(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const uint8_t *const image = taxel_boot_image(&boot->config->flash, packet->data[0]);
    if (!image) {
        return TAXEL_BOOT_STATUS_APPLICATION;
    }
    memset(reply, 0, TAXEL_BOOT_STOCK_METADATA_SIZE);
    memcpy(reply + TAXEL_BOOT_STOCK_METADATA_OFFSET_ENTRY, image + TAXEL_BOOT_IMAGE_HEADER_OFFSET_VECTORS, 4);
    memcpy(reply + TAXEL_BOOT_STOCK_METADATA_OFFSET_LENGTH, image + TAXEL_BOOT_IMAGE_HEADER_OFFSET_LENGTH, 4);
    memcpy(reply + TAXEL_BOOT_STOCK_METADATA_OFFSET_CUSTOM_ID, image + TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32, 4);
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_LAST_BOOTLOADER_ROW] = TAXEL_BOOT_BOOTLOADER_ROWS - 1u;
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_ACTIVE] = packet->data[0] == boot->kept_slot;
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_VERIFIED] = 1;
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_BOOTLOADER_VERSION] = boot->config->version[1];
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_BOOTLOADER_VERSION + 1u] = boot->config->version[0];
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_APPLICATION_ID] = image[TAXEL_BOOT_IMAGE_HEADER_OFFSET_KIND];
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_APPLICATION_VERSION] = image[TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MINOR];
    reply[TAXEL_BOOT_STOCK_METADATA_OFFSET_APPLICATION_VERSION + 1u] =
        image[TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR];
    return TAXEL_BOOT_STATUS_OK;
}

/* Execute the command GET_INFO: reply with the state of the bootloader, the slot for a new image, the boot metadata,
 * I2C address, kind of board and unique id. Before ENTER, also determines the kept slot (the slot that a host must not
 * overwrite). Always returns status OK. */
uint8_t taxel_boot_get_info(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const struct taxel_boot_flash *const flash = &boot->config->flash;
    const uint8_t *const configuration = taxel_boot_configuration(flash);
    (void)packet;
    if (!boot->entered) {
        boot->kept_slot = taxel_boot_kept_slot(flash);
    }
    reply[TAXEL_BOOT_INFO_OFFSET_VERSION] = TAXEL_BOOT_VERSION;
    reply[TAXEL_BOOT_INFO_OFFSET_DEVICE] = flash->layout->device;
    reply[TAXEL_BOOT_INFO_OFFSET_STAY] = boot->stay;
    reply[TAXEL_BOOT_INFO_OFFSET_TARGET] = taxel_boot_target(boot);
    taxel_boot_metadata_read(flash, (struct taxel_boot_metadata *)(reply + TAXEL_BOOT_INFO_OFFSET_CONFIRMED));
    reply[TAXEL_BOOT_INFO_OFFSET_ADDRESS] = taxel_boot_i2c_address(flash);
    reply[TAXEL_BOOT_INFO_OFFSET_KIND] = configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] : 0;
    flash->hal->unique_id(flash->hal->context, reply + TAXEL_BOOT_INFO_OFFSET_UNIQUE_ID);
    return TAXEL_BOOT_STATUS_OK;
}
