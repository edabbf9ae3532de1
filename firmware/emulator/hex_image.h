/* Images in Intel HEX: 32 KiB of flash. */
#ifndef EMULATOR_HEX_IMAGE_H
#define EMULATOR_HEX_IMAGE_H

#include <stddef.h>
#include <stdint.h>

/* What the file says nothing about is 0, as erased flash is. Returns NULL, or what is wrong with the file; *line: where, 0 if it
 * could not be read at all. */
const char *hex_image_read(const char *path, uint8_t *bytes, size_t size, int *line);

#endif
