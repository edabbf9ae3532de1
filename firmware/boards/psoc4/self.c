#include "boards/psoc4/self.h"

#include "boards/psoc4/flash_rows.h"
#include "boards/psoc4/ticks.h"

/* HAL function of the bootloader's parts in the application: write one flash row of 128 bytes. Always returns 0,
 * because the caller reads the row back. */
static int write_row(void *context, uint16_t row, const uint8_t *bytes)
{
    (void)context;
    flash_rows_write(row, bytes);
    return 0;
}

static const struct taxel_boot_hal hal = {
    .flash = (const uint8_t *)0,
    .flash_write_row = write_row,
};

#if IMAGE_DEVICE == 2 && defined TAXEL_BOOT_64K
const struct taxel_boot_flash self_flash = {.hal = &hal, .layout = &taxel_boot_layout_hub_64k};
#elif defined TAXEL_BOOT_64K
const struct taxel_boot_flash self_flash = {.hal = &hal, .layout = &taxel_boot_layout_board_64k};
#elif IMAGE_DEVICE == 2
const struct taxel_boot_flash self_flash = {.hal = &hal, .layout = &taxel_boot_layout_hub};
#elif defined TAXEL_BOOT_ONE_SLOT
const struct taxel_boot_flash self_flash = {.hal = &hal, .layout = &taxel_boot_layout_board_16k};
#else
const struct taxel_boot_flash self_flash = {.hal = &hal, .layout = &taxel_boot_layout_board};
#endif

/* Return the flash slot (0 or 1) for which the running image is linked. */
static uint8_t slot(void)
{
    return image_header[TAXEL_BOOT_IMAGE_HEADER_OFFSET_SLOT];
}

/* Return whether the running image is on trial, that is, has not been confirmed with taxel_boot_confirm(). */
bool self_is_on_trial(void)
{
    return !taxel_boot_is_confirmed(&self_flash, slot());
}

/* Confirm the running image: record in flash that it works. To be called with interrupts off. Not inlined: the function
 * needs a flash row on the stack, for which the frame of main() has no space. */
__attribute__((noinline)) void self_confirm(void)
{
    const uint32_t begin = ticks_stretch();
    /* If the write fails, the image stays on trial, and after its last try the previous image starts. */
    (void)taxel_boot_confirm(&self_flash, slot());
    ticks_shrink(begin);
}
