#include "emulator/world_file/world_image.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "emulator/base/hex_image.h"
#include "emulator/geometry/board_description.h"
#include "generated/taxel_bootloader.h"

#define LARGE_SLOT_A (64u * TAXEL_BOOT_ROW_SIZE) /* address of slot A on a part with 64 KiB */

/* Return the part for which an image is linked: the part with 64 KiB of flash if the image has a header for this part
 * at the start of its slot A, otherwise the standard part. */
static const struct psoc_part *part_of_image(const uint8_t *image)
{
    const uint8_t *const header = image + LARGE_SLOT_A;
    return taxel_get_u32(header) == TAXEL_BOOT_IMAGE_MAGIC &&
                   (header[TAXEL_BOOT_IMAGE_HEADER_OFFSET_DEVICE] == TAXEL_BOOT_DEVICE_BOARD_64K ||
                    header[TAXEL_BOOT_IMAGE_HEADER_OFFSET_DEVICE] == TAXEL_BOOT_DEVICE_HUB_64K)
               ? psoc_part_find("psoc4100s")
               : PSOC_PART_STANDARD;
}

/* Read the firmware image (Intel HEX) that word number `index` of the line names into a new buffer *image. *part: the
 * emulated part that the next word names; without this word, the part follows from the header of the image. The header
 * must be read before the flash size is known, so the file is then read twice. Returns 0, or -1 after an error line on
 * stderr. */
int world_image_read(const struct world_line *line, int index, uint8_t **image, const struct psoc_part **part)
{
    char path[4096];
    int image_line;
    if (index >= line->count) {
        return world_line_report_error(line, "the file name of the image is missing");
    }
    const char *name = line->words[index], *folder_end = strrchr(line->path, '/');
    const int folder = *name == '/' || !folder_end ? 0 : (int)(folder_end - line->path) + 1;
    snprintf(path, sizeof path, "%.*s%s", folder, line->path, name);
    free(*image);
    *image = malloc(WORLD_IMAGE_SIZE);
    if (!*image) {
        return world_line_report_error(line, "out of memory");
    }
    memset(*image, 0, WORLD_IMAGE_SIZE);
    if (index + 1 < line->count) {
        *part = psoc_part_find(line->words[index + 1]);
    } else {
        (void)hex_image_read(path, *image, WORLD_IMAGE_SIZE, &image_line); /* errors are reported below */
        *part = part_of_image(*image);
        memset(*image, 0, WORLD_IMAGE_SIZE);
    }
    if (!*part) {
        return world_line_report_error(line,
                                       "unknown part; expected standard, psoc4100s, original-palm, original-hub ...");
    }
    const char *error = hex_image_read(path, *image, (*part)->flash_size, &image_line);
    if (error) {
        fprintf(stderr, "world %s, line %d: image %s, line %d: %s\n", line->path, line->number, path, image_line,
                error);
        return -1;
    }
    return 0;
}
