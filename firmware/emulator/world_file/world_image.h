/* Firmware images that a world file names. */
#ifndef EMULATOR_WORLD_FILE_WORLD_IMAGE_H
#define EMULATOR_WORLD_FILE_WORLD_IMAGE_H

#include <stdint.h>

#include "emulator/base/world_line.h"
#include "emulator/psoc4/parts.h"

/* Read the firmware image (Intel HEX) whose file name is word number `index` of the line. A relative path starts at the
 * folder of the world file. The next word, if there is one, names the emulated part that executes the image; otherwise the
 * header of the image decides. *image becomes a buffer of WORLD_IMAGE_SIZE bytes. Returns 0, or -1 after an error line on
 * stderr. */
int world_image_read(const struct world_line *line, int index, uint8_t **image, const struct psoc_part **part);

#endif
