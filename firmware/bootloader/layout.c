#include "bootloader/bootloader.h"

#define taxel_boot_layout_BOARD taxel_boot_layout_board
#define taxel_boot_layout_HUB taxel_boot_layout_hub
#define taxel_boot_layout_BOARD_16K taxel_boot_layout_board_16k
#define taxel_boot_layout_BOARD_64K taxel_boot_layout_board_64k
#define taxel_boot_layout_HUB_64K taxel_boot_layout_hub_64k
#define DEFINE(name, first_a, first_b, rows) \
    const struct taxel_boot_layout taxel_boot_layout_##name = {TAXEL_BOOT_DEVICE_##name, rows, {first_a, first_b}};

TAXEL_BOOT_LAYOUTS(DEFINE)
