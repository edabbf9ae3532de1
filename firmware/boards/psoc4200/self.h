/* The running image: its own header, its slot, and its confirmation. */
#ifndef PSOC4200_SELF_H
#define PSOC4200_SELF_H

#include <stdbool.h>
#include <stdint.h>

#include "bootloader/bootloader.h"

extern const struct taxel_boot_flash self_flash;

/* Major, minor, patch. */
extern const uint8_t image_header[]; /* by the linker: start of the slot */
#define SELF_VERSION (image_header + TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR)

/* Whether the running image is not confirmed yet; and its confirmation, to be called with interrupts off. */
bool self_is_on_trial(void);
void self_confirm(void);

#endif
