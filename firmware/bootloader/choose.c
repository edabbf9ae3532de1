/* Selection of the slot to start. An unconfirmed image starts only while it has tries left. */
#include "bootloader/internal.h"

/* Return the slot of the image to start: the pending image, otherwise the confirmed one, otherwise the first valid
 * image. An unconfirmed image is started only while its slot has tries left (remaining start attempts).
 * TAXEL_BOOT_SLOT_NONE if no image can be started. */
uint8_t taxel_boot_choose(const struct taxel_boot_flash *flash, const struct taxel_boot_metadata *metadata)
{
    const uint8_t order[] = {metadata->pending, metadata->confirmed, 0, 1};
    for (size_t i = 0; i < sizeof order; i++) {
        const uint8_t slot = order[i];
        if (slot < TAXEL_BOOT_SLOTS && (slot == metadata->confirmed || metadata->tries[slot]) &&
            taxel_boot_image(flash, slot)) {
            return slot;
        }
    }
    return TAXEL_BOOT_SLOT_NONE;
}

/* Return the slot of the image that is started if the pending image fails; TAXEL_BOOT_SLOT_NONE if there is none. New
 * images must not overwrite this slot. A device with only one slot cannot keep an image. */
uint8_t taxel_boot_kept_slot(const struct taxel_boot_flash *flash)
{
    if (TAXEL_BOOT_SLOTS == 1u) {
        return TAXEL_BOOT_SLOT_NONE;
    }
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    metadata.pending = TAXEL_BOOT_SLOT_NONE;
    return taxel_boot_choose(flash, &metadata);
}
