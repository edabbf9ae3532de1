/* The running image: its own header, its slot, and its confirmation. */
#ifndef PSOC4_SELF_H
#define PSOC4_SELF_H

#include <stdbool.h>
#include <stdint.h>

#include "bootloader/bootloader.h"

extern const struct taxel_boot_flash self_flash;

extern const uint8_t image_header[]; /* by the linker: start of the slot */
/* The three bytes of the image's version: major, minor, patch. */
#define SELF_VERSION (image_header + TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR)

/* Return whether the running image is not confirmed yet; and confirm it, with interrupts off. */
bool self_is_on_trial(void);
void self_confirm(void);

#endif
