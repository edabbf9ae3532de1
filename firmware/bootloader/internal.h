/* Declarations shared by the source files of the bootloader. */
#ifndef TAXEL_BOOT_INTERNAL_H
#define TAXEL_BOOT_INTERNAL_H

#include "bootloader/bootloader.h"

#define TAXEL_BOOT_DATA_OFFSET 4u /* of the data in a packet */

/* packet.c */
struct taxel_boot_packet {
    uint8_t command;
    uint8_t length;
    const uint8_t *data;
};

/* Parse `size` bytes. Returns an enum taxel_boot_status; the length is checked before any byte behind it is read. */
uint8_t taxel_boot_packet_parse(struct taxel_boot_packet *packet, const uint8_t *bytes, size_t size, uint8_t checksum);
/* Add header, checksum and end to the data at bytes + TAXEL_BOOT_DATA_OFFSET. Returns the size of the packet. */
size_t taxel_boot_packet_build(uint8_t *bytes, uint8_t status, uint8_t length, uint8_t checksum);
uint16_t taxel_boot_packet_checksum(const uint8_t *bytes, size_t size, uint8_t checksum);

/* record.c: two rows from `first_row` on, written alternately; the valid one with the later sequence is the newest
 * record, NULL if none is valid. */
const uint8_t *taxel_boot_record_newest(const struct taxel_boot_flash *flash, uint16_t first_row, uint32_t magic);
/* Write a row unless it already has this content, and read it back. Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_write_row(const struct taxel_boot_flash *flash, uint16_t row, const uint8_t *bytes);
const uint8_t *taxel_boot_row(const struct taxel_boot_flash *flash, uint16_t row);
/* taxel_get_u32() and taxel_put_u32() as functions: their inline code is long on a Cortex-M0. */
uint32_t taxel_boot_u32(const uint8_t *bytes);
void taxel_boot_put_u32(uint8_t *bytes, uint32_t value);

/* metadata.c */
void taxel_boot_metadata_read(const struct taxel_boot_flash *flash, struct taxel_boot_metadata *metadata);
int taxel_boot_metadata_write(const struct taxel_boot_flash *flash, const struct taxel_boot_metadata *metadata);
#ifdef TAXEL_BOOT_ONE_SLOT
/* Record that no image may start until the next one is pending. */
int taxel_boot_metadata_forget(const struct taxel_boot_flash *flash);
#endif
/* Make this slot's image pending; for the confirmed slot, clear the pending one. */
int taxel_boot_metadata_set_pending(const struct taxel_boot_flash *flash, uint8_t slot);

/* image.c: return the header of the bootable image in this slot, or NULL if there is none. */
const uint8_t *taxel_boot_image(const struct taxel_boot_flash *flash, uint8_t slot);

/* choose.c: return the slot to start, and the slot to keep; both may be TAXEL_BOOT_SLOT_NONE. */
uint8_t taxel_boot_choose(const struct taxel_boot_flash *flash, const struct taxel_boot_metadata *metadata);
uint8_t taxel_boot_kept_slot(const struct taxel_boot_flash *flash);
/* Return the free slot, to which the host may write: the one that is not kept; slot 0 if none is kept. */
static inline uint8_t taxel_boot_target(const struct taxel_boot *boot)
{
    return boot->kept_slot == 0u ? 1u : 0u;
}

/* Handler of a command: reads the packet, writes the response's data to `reply`. Returns an enum taxel_boot_status.
 * The lengths of both are in the table of commands.c. */
typedef uint8_t taxel_boot_handler(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply);

/* rows.c */
taxel_boot_handler taxel_boot_send_data, taxel_boot_program_row, taxel_boot_erase_row, taxel_boot_verify_row,
    taxel_boot_verify_application;
/* reports.c */
taxel_boot_handler taxel_boot_get_flash_size, taxel_boot_get_application_status, taxel_boot_get_metadata,
    taxel_boot_get_info;
/* search.c */
taxel_boot_handler taxel_boot_search;
/* config_rows.c */
taxel_boot_handler taxel_boot_read_configuration, taxel_boot_write_configuration;

#endif
