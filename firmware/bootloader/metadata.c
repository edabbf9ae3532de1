#include "bootloader/parts.h"

void taxel_boot_metadata_read(const struct taxel_boot_flash *flash, struct taxel_boot_metadata *metadata)
{
    /* Nothing recorded: whatever image is there has still to confirm itself. */
    static const uint8_t blank[TAXEL_BOOT_METADATA_SIZE] = {TAXEL_BOOT_SLOT_NONE, TAXEL_BOOT_SLOT_NONE, TAXEL_BOOT_TRIES,
                                                            TAXEL_BOOT_TRIES};
    const uint8_t *const record =
        taxel_boot_record_newest(flash, TAXEL_BOOT_METADATA_ROW, TAXEL_BOOT_METADATA_MAGIC);
    taxel_boot_metadata_unpack(metadata, record ? record + TAXEL_BOOT_RECORD_OFFSET_PAYLOAD : blank);
}

int taxel_boot_metadata_write(const struct taxel_boot_flash *flash, const struct taxel_boot_metadata *metadata)
{
    uint8_t bytes[TAXEL_BOOT_METADATA_SIZE];
    taxel_boot_metadata_pack(metadata, bytes);
    return taxel_boot_record_write(flash, TAXEL_BOOT_METADATA_ROW, TAXEL_BOOT_METADATA_MAGIC, bytes, sizeof bytes);
}

int taxel_boot_metadata_set_pending(const struct taxel_boot_flash *flash, uint8_t slot)
{
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    metadata.pending = slot == metadata.confirmed ? TAXEL_BOOT_SLOT_NONE : slot;
    metadata.tries[slot] = TAXEL_BOOT_TRIES;
    return taxel_boot_metadata_write(flash, &metadata);
}
