/* Linked into an application: it works, keep it. */
#include "bootloader/parts.h"

bool taxel_boot_is_confirmed(const struct taxel_boot_flash *flash, uint8_t slot)
{
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    return metadata.confirmed == slot;
}

int taxel_boot_confirm(const struct taxel_boot_flash *flash, uint8_t slot)
{
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    if (slot > 1u || metadata.confirmed == slot) {
        return 0;
    }
    metadata.confirmed = slot;
    metadata.pending = TAXEL_BOOT_SLOT_NONE;
    metadata.tries[slot] = TAXEL_BOOT_TRIES; /* it may be fallen back upon when another is confirmed */
    return taxel_boot_metadata_write(flash, &metadata);
}
