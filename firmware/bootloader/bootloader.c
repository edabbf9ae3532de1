#include "bootloader/bootloader.h"

#include "bootloader/internal.h"

/* Initialise the bootloader. A bootloader that the application requested before the reset stays without a time limit;
 * otherwise it waits TAXEL_BOOT_LISTEN_US for a host. `config` must stay valid. */
void taxel_boot_init(struct taxel_boot *boot, const struct taxel_boot_config *config)
{
    const struct taxel_boot_hal *const hal = config->flash.hal;
    memset(boot, 0, sizeof *boot);
    boot->config = config;
    boot->started_us = hal->clock_us(hal->context);
    boot->checksum = config->checksum == TAXEL_BOOT_CHECKSUM_CRC;
    boot->kept_slot = TAXEL_BOOT_SLOT_NONE;
    boot->stay = hal->stay_requested(hal->context) ? TAXEL_BOOT_STAY_REQUESTED : TAXEL_BOOT_STAY_LISTENING;
}

/* Start the image that the metadata select. On silicon this function returns only if no image can be started. The start
 * of an unconfirmed image (on trial) uses up one of its tries, which is recorded in flash before the start; an image
 * whose try cannot be recorded is not started. */
static void start_image(struct taxel_boot *boot)
{
    const struct taxel_boot_flash *const flash = &boot->config->flash;
    struct taxel_boot_metadata metadata;
    taxel_boot_metadata_read(flash, &metadata);
    for (;;) {
        const uint8_t slot = taxel_boot_choose(flash, &metadata);
        if (slot == TAXEL_BOOT_SLOT_NONE) {
            boot->stay = TAXEL_BOOT_STAY_NO_IMAGE;
            return;
        }
        if (slot != metadata.confirmed) {
            metadata.pending = slot;
            metadata.tries[slot]--;
            if (taxel_boot_metadata_write(flash, &metadata)) {
                /* In RAM only: the slot has no try left, so that the next pass chooses another slot. */
                metadata.tries[slot] = 0;
                continue;
            }
        }
        const uint8_t *const header = taxel_boot_row(flash, flash->layout->first_rows[slot]);
        boot->started = true;
        flash->hal->start(flash->hal->context, taxel_boot_u32(header + TAXEL_BOOT_IMAGE_HEADER_OFFSET_VECTORS));
        return;
    }
}

/* Run one pass of the main loop: restart if a command requested a restart, or start the application when no host has
 * sent ENTER within TAXEL_BOOT_LISTEN_US. After a reset by command the application starts at once. */
void taxel_boot_run(struct taxel_boot *boot)
{
    const struct taxel_boot_hal *const hal = boot->config->flash.hal;
    if (boot->restart_requested) {
        boot->restart_requested = false;
        hal->restart(hal->context);
        return;
    }
    if (boot->stay == TAXEL_BOOT_STAY_LISTENING && !boot->started &&
        (hal->reset_cause(hal->context) == TAXEL_RESET_CAUSE_COMMAND ||
         hal->clock_us(hal->context) - boot->started_us >= TAXEL_BOOT_LISTEN_US)) {
        start_image(boot);
    }
}
