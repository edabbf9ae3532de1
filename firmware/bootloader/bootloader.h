/* The bootloader: two slots, of which one always holds an image that boots; Cypress bootloader packets from either wire.
 *
 *   packet.c       checksums, one packet in, one out     bootloader.c   set-up, the main loop's pass, the start
 *   record.c       a row pair written in turn            commands.c     what a packet asks for
 *   metadata.c     which image is confirmed or on trial  rows.c         writing and checking the free slot
 *   config_rows.c  address, kind, serial, calibration    reports.c      what a host asks about images and board
 *   image.c        is there an image in that slot        i2c.c, uart.c  one packet from the wire, one response to it
 *   choose.c       which slot boots, which is free       search.c       boards that share an address
 *   layout.c       where the slots lie                   confirm.c      linked into applications, not into bootloaders
 *
 * The port calls taxel_boot_init(), then taxel_boot_run() from its main loop, and hands bytes to i2c.c or uart.c from its
 * interrupts. All memory is the caller's. Nothing here divides, allocates or waits. */
#ifndef TAXEL_BOOTLOADER_H
#define TAXEL_BOOTLOADER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_bootloader.h"
#include "hal/boot_hal.h"

#define TAXEL_BOOT_ERROR_FLASH (-5) /* a row could not be written, or reads back as something else */

/* Where the slots lie (layout.c). */
struct taxel_boot_layout {
    uint8_t device; /* enum taxel_boot_device */
    uint8_t slot_rows;
    uint8_t first_rows[2];
};

extern const struct taxel_boot_layout taxel_boot_layout_board, taxel_boot_layout_hub;

/* What both the bootloader and an application's taxel_boot_confirm() work on. */
struct taxel_boot_flash {
    const struct taxel_boot_hal *hal;
    const struct taxel_boot_layout *layout;
};

struct taxel_boot_config {
    struct taxel_boot_flash flash;
    const uint8_t *key;        /* TAXEL_BOOT_KEY_SIZE bytes that ENTER must bring, or NULL */
    uint8_t checksum;          /* enum taxel_boot_checksum */
    uint8_t silicon_revision;  /* told by ENTER */
    uint8_t version[3];        /* of the bootloader, told by ENTER */
};

struct taxel_boot {
    const struct taxel_boot_config *config;
    uint32_t started_us;
    uint8_t stay;     /* enum taxel_boot_stay */
    uint8_t checksum; /* kind of the session, or of the last packet while nobody has entered */
    uint8_t keep;     /* the slot that may not be written, or TAXEL_BOOT_SLOT_NONE */
    bool silent;      /* a search named other boards */
    bool entered;
    bool programmed; /* a row of the free slot was written since ENTER */
    bool restart_requested;
    bool started;
    uint8_t fill; /* bytes of row[] that have come */
    uint8_t row[TAXEL_BOOT_ROW_SIZE];
};

/* bootloader.c. After init the image starts in taxel_boot_run(), at once or when nobody has entered for BOOT_LISTEN_US. */
void taxel_boot_init(struct taxel_boot *boot, const struct taxel_boot_config *config);
void taxel_boot_run(struct taxel_boot *boot);

/* commands.c. One packet as it came from a wire; `response` has room for TAXEL_BOOT_PACKET_MAX bytes. Returns the bytes of
 * the response, 0 if there is none. */
size_t taxel_boot_take_packet(struct taxel_boot *boot, const uint8_t *packet, size_t size, uint8_t *response);

/* config_rows.c. The board's configuration as packed bytes, or NULL if it has none. For applications too. */
const uint8_t *taxel_boot_configuration(const struct taxel_boot_flash *flash);

/* i2c.c: a slave at taxel_boot_i2c_address(). on_address and on_write return whether to acknowledge. */
struct taxel_boot_i2c {
    struct taxel_boot *boot;
    volatile bool has_packet;
    volatile uint8_t response_size;
    uint8_t received; /* TAXEL_BOOT_PACKET_MAX + 1: too many */
    uint8_t readable, position;
    uint8_t packet[TAXEL_BOOT_PACKET_MAX];
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
};

void taxel_boot_i2c_init(struct taxel_boot_i2c *slave, struct taxel_boot *boot);
uint8_t taxel_boot_i2c_address(const struct taxel_boot_flash *flash);
bool taxel_boot_i2c_on_address(struct taxel_boot_i2c *slave, bool reading);
bool taxel_boot_i2c_on_write(struct taxel_boot_i2c *slave, uint8_t byte);
uint8_t taxel_boot_i2c_on_read(struct taxel_boot_i2c *slave);
void taxel_boot_i2c_on_stop(struct taxel_boot_i2c *slave);
void taxel_boot_i2c_on_bus_error(struct taxel_boot_i2c *slave);
/* The main loop's pass: in place of taxel_boot_run(). */
void taxel_boot_i2c_run(struct taxel_boot_i2c *slave);

/* uart.c: the same packets on a UART. */
struct taxel_boot_uart {
    struct taxel_boot *boot;
    volatile bool has_packet;
    bool skipping; /* until the line is silent */
    uint32_t last_byte_us;
    uint8_t received;
    uint8_t response_size, position;
    uint8_t packet[TAXEL_BOOT_PACKET_MAX];
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
};

void taxel_boot_uart_init(struct taxel_boot_uart *uart, struct taxel_boot *boot);
void taxel_boot_uart_on_byte(struct taxel_boot_uart *uart, uint8_t byte);
/* The next bytes of the response, up to `size`; returns how many. */
size_t taxel_boot_uart_pull(struct taxel_boot_uart *uart, uint8_t *bytes, size_t size);
void taxel_boot_uart_run(struct taxel_boot_uart *uart);

/* confirm.c, for applications: the image in `slot` works and is to stay. Writes one row, up to 20 ms, or nothing if it is
 * confirmed already. Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_confirm(const struct taxel_boot_flash *flash, uint8_t slot);
/* Whether that call would write. */
bool taxel_boot_is_confirmed(const struct taxel_boot_flash *flash, uint8_t slot);

#endif
