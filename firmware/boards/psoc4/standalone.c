/* Constants of an image without slots. Built without link-time optimisation: the image tool changes the address in the
 * linked image, so that the compiler must not replace reads of the address by its value. */
#include "boards/psoc4/standalone.h"

#include "boards/psoc4/regs/core.h"
#include "boards/psoc4/self.h"

/* Only the version is read, at the position of an image header with slots. */
__attribute__((section(".image_header"), used)) const uint8_t image_header[TAXEL_BOOT_IMAGE_HEADER_SIZE] = {
    [TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR] = BOARD_VERSION_MAJOR,
    [TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR + 1] = BOARD_VERSION_MINOR,
    [TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR + 2] = BOARD_VERSION_PATCH,
};

#ifdef BOARD_RX_LINES
__attribute__((used)) const uint8_t standalone_configuration[] = {
    [0] = TAXEL_BOOT_VERSION,
    [TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS] = BOARD_ADDRESS,
    [TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] = BOARD_KIND,
    [TAXEL_BOOT_CONFIGURATION_OFFSET_IDAC_CODES + STANDALONE_CODES - 1u] = 0, /* 0: code of the scan settings */
};
#endif

void reset_handler(void);
void standalone_entry(void);
/* Enter the image from the original bootloader, which jumps here with its own stack pointer: set the stack pointer and
 * continue as after a reset. */
__attribute__((naked, section(".text.standalone_entry"), used)) void standalone_entry(void)
{
    __asm__("ldr r0, =stack_top\n\tmov sp, r0\n\tldr r0, =reset_handler\n\tbx r0\n\t.ltorg");
}
