/* The bootloader of an emulated board, the real one, and the flash that it works on. An image's code is not executed here:
 * what runs is the sensor firmware that this program is built with, under the version that the image's header gives. An image
 * whose code begins with the four characters HANG never answers; the watchdog ends it after a second. */
#ifndef EMULATOR_BOARD_BOOT_H
#define EMULATOR_BOARD_BOOT_H

#include "bootloader/bootloader.h"
#include "emulator/flash.h"
#include "emulator/world_file.h"

#define BOARD_BOOT_INIT (2u * VTIME_MS) /* estimate: from the reset until the bootloader answers; of short boots, half */
#define BOARD_BOOT_WATCHDOG VTIME_SECOND

enum board_boot_outcome {
    BOARD_BOOT_STAYS,
    BOARD_BOOT_STARTS,
    BOARD_BOOT_HANGS, /* an image was started that will not answer */
    BOARD_BOOT_RESTARTS,
};

struct board_boot {
    struct flash flash;
    struct taxel_boot_hal hal;
    struct taxel_boot_config config;
    struct taxel_boot boot;
    struct taxel_boot_i2c i2c;
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
void board_boot_init(struct board_boot *boot, const struct world_description *world,
                     const struct board_description *description);

/* Power-up or reset. Afterwards as below. */
enum board_boot_outcome board_boot_reset(struct board_boot *boot, vtime now, uint8_t cause);
void board_boot_power_off(struct board_boot *boot, vtime now);

/* When its main loop has something to do without a packet: the 100 ms are over. VTIME_NEVER: never. */
vtime board_boot_deadline(const struct board_boot *boot);

/* The main loop, up to `now`: what becomes of the board, at boot->now. */
enum board_boot_outcome board_boot_run(struct board_boot *boot, vtime now);

/* Of the image that runs, or was started last. */
const uint8_t *board_boot_version(const struct board_boot *boot);
uint8_t board_boot_address(const struct board_boot *boot);
uint8_t board_boot_kind(const struct board_boot *boot);

/* The application has shown that it works. Returns until when a row is being written, or 0. */
vtime board_boot_confirm(struct board_boot *boot, vtime now);

#endif
