#include "bootloader/internal.h"

/* The struct has the same four bytes in the same order, so that it is copied as a whole, which is shorter on a
 * Cortex-M0. */
_Static_assert(sizeof(struct taxel_boot_metadata) == TAXEL_BOOT_METADATA_SIZE, "metadata are bytes");

/* Read the newest boot metadata: confirmed slot, pending slot, and remaining tries of both slots. Without a valid
 * record, no slot is confirmed or pending, and each slot has TAXEL_BOOT_TRIES tries. */
void taxel_boot_metadata_read(const struct taxel_boot_flash *flash, struct taxel_boot_metadata *metadata)
{
    /* No valid record: no image is confirmed. */
    static const uint8_t blank[TAXEL_BOOT_METADATA_SIZE] = {TAXEL_BOOT_SLOT_NONE, TAXEL_BOOT_SLOT_NONE,
                                                            TAXEL_BOOT_TRIES, TAXEL_BOOT_TRIES};
    const uint8_t *const record = taxel_boot_record_newest(flash, TAXEL_BOOT_METADATA_ROW, TAXEL_BOOT_METADATA_MAGIC);
    memcpy(metadata, record ? record + TAXEL_BOOT_RECORD_OFFSET_PAYLOAD : blank, sizeof blank);
}

/* Write the metadata (confirmed slot, pending slot, and remaining tries of both slots) as a record to flash. Returns 0
 * or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_metadata_write(const struct taxel_boot_flash *flash, const struct taxel_boot_metadata *metadata)
{
    return taxel_boot_record_write(flash, TAXEL_BOOT_METADATA_ROW, TAXEL_BOOT_METADATA_MAGIC, (const uint8_t *)metadata,
                                   sizeof *metadata);
}

#ifdef TAXEL_BOOT_ONE_SLOT
/* Record that no image may start: none is confirmed or pending, and none has a try. Called before the only slot is
 * overwritten, so that an image that is not completely written never starts. Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_metadata_forget(const struct taxel_boot_flash *flash)
{
    static const struct taxel_boot_metadata none = {TAXEL_BOOT_SLOT_NONE, TAXEL_BOOT_SLOT_NONE, {0, 0}};
    return taxel_boot_metadata_write(flash, &none);
}
#endif

/* Make the image in `slot` the pending one, which is started next, with its full number of tries; for the confirmed
 * slot, make none pending. Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_metadata_set_pending(const struct taxel_boot_flash *flash, uint8_t slot)
{
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    metadata.pending = slot == metadata.confirmed ? TAXEL_BOOT_SLOT_NONE : slot;
    metadata.tries[slot] = TAXEL_BOOT_TRIES;
    return taxel_boot_metadata_write(flash, &metadata);
}
