/* Read a firmware image in Intel HEX format into a buffer. */
#ifndef EMULATOR_BASE_HEX_IMAGE_H
#define EMULATOR_BASE_HEX_IMAGE_H

#include <stddef.h>
#include <stdint.h>

/* Read a file into `bytes` (`size` bytes). Bytes that the file does not define are 0, like erased flash of a PSoC 4200.
 * Returns NULL on success, otherwise the error message; *line is the line of the error, or 0 if the file cannot be
 * read. */
const char *hex_image_read(const char *path, uint8_t *bytes, size_t size, int *line);

#endif
