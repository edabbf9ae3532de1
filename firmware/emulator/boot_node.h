/* The bootloader of an emulated board or hub, the real one, and the flash that it works on. An image's code is not executed
 * here: what runs is the firmware that this program is built with, under the version that the image's header gives. An image
 * whose code begins with the four characters HANG never answers; the watchdog ends it after a second. */
#ifndef EMULATOR_BOOT_NODE_H
#define EMULATOR_BOOT_NODE_H

#include "bootloader/bootloader.h"
#include "emulator/flash.h"
#include "emulator/world_file.h"

#define BOOT_NODE_INIT (2u * VTIME_MS) /* estimate: from the reset until the bootloader answers; of short boots, half */
#define BOOT_NODE_WATCHDOG VTIME_SECOND

/* What runs on a board or the hub. */
enum boot_node_runs {
    RUNS_APPLICATION,
    RUNS_BOOTLOADER,
    RUNS_NOTHING, /* an image that does not answer, until its watchdog bites */
};

enum boot_node_outcome {
    BOOT_NODE_STAYS,
    BOOT_NODE_STARTS,
    BOOT_NODE_HANGS, /* an image was started that will not answer */
    BOOT_NODE_RESTARTS,
};

struct boot_node {
    struct flash flash;
    struct taxel_boot_hal hal;
    struct taxel_boot_config config;
    struct taxel_boot boot;
    struct taxel_boot_i2c i2c;   /* of a board */
    struct taxel_boot_uart uart; /* of the hub */
    bool is_hub;
    uint8_t unique_id[8];
    bool listens;    /* 100 ms after power-up, as on silicon */
    bool stay;       /* the application asked for the bootloader; a reset leaves it alone */
    uint8_t cause;
    uint8_t slot;    /* whose image runs */
    vtime init_time, reset_at, now, busy_until;
    bool wants_start, wants_restart;
};

/* As it leaves the factory: the image of slot A confirmed, address, kind and serial number configured; or blank: nothing but
 * the bootloader. */
void boot_node_init(struct boot_node *boot, const struct world_description *world,
                    const struct board_description *description);
/* The hub's; NULL for its version is the world's own. */
void boot_node_init_hub(struct boot_node *boot, const struct world_description *world, const uint8_t unique_id[8]);

/* Power-up or reset. Afterwards as below. */
enum boot_node_outcome boot_node_reset(struct boot_node *boot, vtime now, uint8_t cause);
void boot_node_power_off(struct boot_node *boot, vtime now);

/* When its main loop has something to do without a packet: the 100 ms are over. VTIME_NEVER: never. */
vtime boot_node_deadline(const struct boot_node *boot);

/* The main loop, up to `now`: what becomes of the board, at boot->now. */
enum boot_node_outcome boot_node_run(struct boot_node *boot, vtime now);

/* Of the image that runs, or was started last. */
const uint8_t *boot_node_version(const struct boot_node *boot);
uint8_t boot_node_address(const struct boot_node *boot);
uint8_t boot_node_kind(const struct boot_node *boot);

/* The application has shown that it works. Returns until when a row is being written, or 0. */
vtime boot_node_confirm(struct boot_node *boot, vtime now);

#endif
