/* Linked into an application: confirmation of the running image. */
#include "bootloader/internal.h"

/* Return whether the metadata in flash state that the image in `slot` (0 or 1) is confirmed, that is, has shown that it
 * works. */
bool taxel_boot_is_confirmed(const struct taxel_boot_flash *flash, uint8_t slot)
{
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    return metadata.confirmed == slot;
}

/* Mark the image in `slot` (0 or 1) as confirmed, so that it is started after every reset; called by the application.
 * Does nothing for any other slot and for a confirmed image. Returns 0, or a negative number if the flash could not be
 * written. */
int taxel_boot_confirm(const struct taxel_boot_flash *flash, uint8_t slot)
{
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    if (slot >= TAXEL_BOOT_SLOTS || metadata.confirmed == slot) {
        return 0;
    }
    metadata.confirmed = slot;
    metadata.pending = TAXEL_BOOT_SLOT_NONE;
    metadata.tries[slot] = TAXEL_BOOT_TRIES; /* for a later fallback to this image, after another one is confirmed */
    return taxel_boot_metadata_write(flash, &metadata);
}
