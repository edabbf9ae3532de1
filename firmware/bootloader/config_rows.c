#include "bootloader/internal.h"

/* Return the stored configuration of the board (TAXEL_BOOT_CONFIGURATION_SIZE bytes in flash), or NULL if there is
 * none. */
const uint8_t *taxel_boot_configuration(const struct taxel_boot_flash *flash)
{
    const uint8_t *const record =
        taxel_boot_record_newest(flash, TAXEL_BOOT_CONFIGURATION_ROW, TAXEL_BOOT_CONFIGURATION_MAGIC);
    return record ? record + TAXEL_BOOT_RECORD_OFFSET_PAYLOAD : NULL;
}

/* Execute the command READ_CONFIGURATION: reply with the board's stored configuration (I2C address, kind, serial
 * number, calibration). Returns status DATA if none is stored, otherwise OK. */
uint8_t taxel_boot_read_configuration(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const uint8_t *const configuration = taxel_boot_configuration(&boot->config->flash);
    (void)packet;
    if (!configuration) {
        return TAXEL_BOOT_STATUS_DATA;
    }
    memcpy(reply, configuration, TAXEL_BOOT_CONFIGURATION_SIZE);
    return TAXEL_BOOT_STATUS_OK;
}

/* Execute the command WRITE_CONFIGURATION: store the board's configuration. The arguments begin with the unique id of
 * the processor, so that only the intended board changes if several share an I2C address. Returns status OK, or DEVICE
 * (another unique id), VERSION, DATA (an invalid I2C address) or VERIFY (the flash could not be written). */
uint8_t taxel_boot_write_configuration(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const struct taxel_boot_flash *const flash = &boot->config->flash;
    const uint8_t *const bytes = packet->data + TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_OFFSET_CONFIGURATION_VERSION;
    const unsigned address = bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS];
    flash->hal->unique_id(flash->hal->context, reply);
    if (memcmp(reply, packet->data, (size_t)(bytes - packet->data)) != 0) {
        return TAXEL_BOOT_STATUS_DEVICE;
    }
    if (bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_VERSION] != TAXEL_BOOT_VERSION) {
        return TAXEL_BOOT_STATUS_VERSION;
    }
    /* unsigned: the difference of an address below the minimum is very large */
    if (address - TAXEL_ADDRESS_MIN > TAXEL_ADDRESS_MAX - TAXEL_ADDRESS_MIN) {
        return TAXEL_BOOT_STATUS_DATA;
    }
    return taxel_boot_record_write(flash, TAXEL_BOOT_CONFIGURATION_ROW, TAXEL_BOOT_CONFIGURATION_MAGIC, bytes,
                                   TAXEL_BOOT_CONFIGURATION_SIZE)
               ? TAXEL_BOOT_STATUS_VERIFY
               : TAXEL_BOOT_STATUS_OK;
}
