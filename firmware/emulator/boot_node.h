/* The bootloader of an emulated board or hub (the real bootloader, compiled natively) and its flash.
 *
 * The code of an image is not executed here: the application is the firmware that this program is compiled with, under
 * the version in the header of the image. An image whose code starts with the four characters HANG does not respond;
 * the watchdog resets the processor after one second. */
#ifndef EMULATOR_BOOT_NODE_H
#define EMULATOR_BOOT_NODE_H

#include "bootloader/bootloader.h"
#include "emulator/base/flash.h"
#include "emulator/world_file/world_file.h"

/* estimate: reset to the bootloader's first response; at most half of boot_ms */
#define BOOT_NODE_INIT_TIME (2u * VTIME_MS)
#define BOOT_NODE_WATCHDOG_TIME VTIME_SECOND

enum running_program {
    PROGRAM_APPLICATION,
    PROGRAM_BOOTLOADER,
    PROGRAM_HANGING, /* an image that does not respond, until the watchdog resets the processor */
};

enum boot_outcome {
    BOOT_STAYS_IN_BOOTLOADER,
    BOOT_STARTS_IMAGE,
    BOOT_STARTS_HANGING_IMAGE,
    BOOT_RESTARTS,
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
    bool listens;        /* waits 100 ms for a host after power-up, like the bootloader in silicon */
    bool stay_requested; /* by the application; survives a reset */
    uint8_t reset_cause;
    uint8_t slot; /* of the running image */
    vtime init_time, reset_at, now, busy_until;
    bool start_requested, restart_requested;
};

/* Set up a board as after production: a confirmed image in slot A and a configuration with address, kind and serial
 * number; or, for a blank board, nothing but the bootloader. */
void boot_node_init(struct boot_node *boot, const struct world_description *world,
                    const struct board_description *description);
void boot_node_init_hub(struct boot_node *boot, const struct world_description *world, const uint8_t unique_id[8]);

/* Perform a power-up or reset. Returns what happens next, at the time boot->now. */
enum boot_outcome boot_node_reset(struct boot_node *boot, vtime now, uint8_t reset_cause);
void boot_node_power_off(struct boot_node *boot, vtime now);

/* Return when boot_node_run() must be called although no packet has arrived: at the end of the 100 ms. VTIME_NEVER: not
 * at all. */
vtime boot_node_next_deadline(const struct boot_node *boot);

/* Run one pass of the bootloader's main loop. Returns what happens next, at the time boot->now. */
enum boot_outcome boot_node_run(struct boot_node *boot, vtime now);

/* Return the version (3 bytes) of the image that runs or was started last, the configured address, and the configured
 * kind. */
const uint8_t *boot_node_get_version(const struct boot_node *boot);
uint8_t boot_node_get_address(const struct boot_node *boot);
uint8_t boot_node_get_kind(const struct boot_node *boot);

/* Confirm the running image. Returns the end of the flash write, or 0 if the image was confirmed before. */
vtime boot_node_confirm_image(struct boot_node *boot, vtime now);

#endif
