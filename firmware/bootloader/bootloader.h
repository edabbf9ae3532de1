/* The bootloader: two slots, of which one always holds a bootable image; Cypress bootloader packets over I2C or UART.
 *
 *   packet.c       checksums, parsing, building          bootloader.c   set-up, main loop, start of an image
 *   record.c       a pair of rows written alternately    commands.c     command table and dispatch
 *   metadata.c     image confirmed, pending or on trial  rows.c         writes and checks the free slot
 *   config_rows.c  address, kind, serial, calibration    reports.c      reports on images and board
 *   image.c        checks the image in a slot            i2c.c, uart.c  one packet from the wire, one response to it
 *   choose.c       the slot that boots, the free slot    search.c       boards that share an address
 *   layout.c       position of the slots                 confirm.c      linked into applications, not into bootloaders
 *
 * Integration on an I2C slave (`hal`: struct taxel_boot_hal of the port; on a UART, taxel_boot_uart_... in the same
 * way):
 *
 *     static struct taxel_boot boot;
 *     static struct taxel_boot_i2c slave;
 *     static const struct taxel_boot_config config = {
 *         .flash = {.hal = &hal, .layout = &taxel_boot_layout_board},
 *         .checksum = TAXEL_BOOT_CHECKSUM_ANY, .version = {1, 0, 0},
 *     };
 *     taxel_boot_init(&boot, &config);
 *     taxel_boot_i2c_init(&slave, &boot);
 *     configure_slave(taxel_boot_i2c_address(&config.flash));
 *     for (;;) {
 *         taxel_boot_i2c_run(&slave);  // may start an image, which does not return
 *         wait_for_interrupt();        // at least every millisecond
 *     }
 *     // I2C slave interrupt: taxel_boot_i2c_on_address(), _on_write(), _on_read(), _on_stop(), _on_bus_error()
 *     // application:         taxel_boot_confirm(&flash, slot) once it has shown that it works
 *
 * All memory is the caller's. No function divides, allocates or waits. firmware/tests/test_integration_examples.c
 * compiles and runs this example. */
#ifndef TAXEL_BOOTLOADER_H
#define TAXEL_BOOTLOADER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_bootloader.h"
#include "hal/boot_hal.h"

#define TAXEL_BOOT_ERROR_FLASH (-5) /* a row could not be written, or reads back as something else */

/* Number of a row at which a slot can begin. One byte where it is sufficient, because it takes less flash. */
#if TAXEL_BOOT_ROW_COUNT > 256
typedef uint16_t taxel_boot_first_row;
#else
typedef uint8_t taxel_boot_first_row;
#endif

/* Position of the slots in flash (layout.c), in rows of 128 bytes. */
struct taxel_boot_layout {
    uint8_t device; /* enum taxel_boot_device */
    uint8_t slot_rows;
    taxel_boot_first_row first_rows[2];
};

#ifdef TAXEL_BOOT_ONE_SLOT
extern const struct taxel_boot_layout taxel_boot_layout_board_16k;
#elif defined TAXEL_BOOT_64K
extern const struct taxel_boot_layout taxel_boot_layout_board_64k, taxel_boot_layout_hub_64k;
#else
extern const struct taxel_boot_layout taxel_boot_layout_board, taxel_boot_layout_hub;
#endif

/* Flash of the device, used by the bootloader and by an application's taxel_boot_confirm(). */
struct taxel_boot_flash {
    /* Functions of the port. A bootloader sets every pointer; an application needs flash and flash_write_row only. */
    const struct taxel_boot_hal *hal;

    /* &taxel_boot_layout_board or &taxel_boot_layout_hub; with TAXEL_BOOT_ONE_SLOT &taxel_boot_layout_board_16k, with
     * TAXEL_BOOT_64K &taxel_boot_layout_board_64k or &taxel_boot_layout_hub_64k. */
    const struct taxel_boot_layout *layout;
};

struct taxel_boot_config {
    struct taxel_boot_flash flash;

    /* TAXEL_BOOT_KEY_SIZE (6) bytes that ENTER must contain; NULL: no key is required. */
    const uint8_t *key;

    /* enum taxel_boot_checksum of the packets: SUM, CRC, or ANY (the checksum of the host's first valid packet). */
    uint8_t checksum;

    /* Revision of the silicon, 0 to 255. Reported by ENTER. */
    uint8_t silicon_revision;

    /* Version of the bootloader, 3 bytes, each 0 to 255. Reported by ENTER. */
    uint8_t version[3];
};

struct taxel_boot {
    const struct taxel_boot_config *config;
    uint32_t started_us;
    uint8_t stay;      /* enum taxel_boot_stay */
    uint8_t checksum;  /* of the session, or, before ENTER, of the last packet */
    uint8_t kept_slot; /* the slot that must not be written, or TAXEL_BOOT_SLOT_NONE */
    bool silent;       /* a search selected other boards */
    bool entered;      /* a host has sent ENTER since the reset */
    bool programmed;   /* a row of the free slot was written since ENTER */
    bool restart_requested;
    bool started; /* the start of an image was requested: only a test returns from it */
    uint8_t fill; /* bytes received into row[] */
    uint8_t row[TAXEL_BOOT_ROW_SIZE];
};

/* bootloader.c. taxel_boot_run() starts the image: at once after a commanded reset, otherwise if no host has sent ENTER
 * for TAXEL_BOOT_LISTEN_US. */
void taxel_boot_init(struct taxel_boot *boot, const struct taxel_boot_config *config);
void taxel_boot_run(struct taxel_boot *boot);

/* commands.c. Execute one packet as received; `response` has space for TAXEL_BOOT_PACKET_MAX bytes. Returns the size
 * of the response, 0 if there is none. */
size_t taxel_boot_take_packet(struct taxel_boot *boot, const uint8_t *bytes, size_t size, uint8_t *response);

/* config_rows.c. Return the board's configuration as packed bytes in flash, or NULL if it has none. For applications
 * too. */
const uint8_t *taxel_boot_configuration(const struct taxel_boot_flash *flash);

/* record.c. Write these bytes as the newest record of the two rows from `first_row` on, unless they are equal to it.
 * Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_record_write(const struct taxel_boot_flash *flash, uint16_t first_row, uint32_t magic,
                            const uint8_t *content, uint8_t size);

/* i2c.c: a slave at taxel_boot_i2c_address(). on_address and on_write return whether to acknowledge. */
struct taxel_boot_i2c {
    struct taxel_boot *boot;
    volatile bool has_packet;
    volatile uint8_t response_size;
    uint8_t received; /* TAXEL_BOOT_PACKET_MAX + 1: the packet is too long */
    uint8_t readable; /* bytes of the response that the present read returns */
    uint8_t position; /* of the next byte to be read */
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
/* Run one pass of the main loop: execute a received packet, then call taxel_boot_run(). */
void taxel_boot_i2c_run(struct taxel_boot_i2c *slave);

/* uart.c: the same packets over a UART. */
struct taxel_boot_uart {
    struct taxel_boot *boot;
    volatile bool has_packet;
    bool skipping; /* bytes are ignored until the line is silent */
    uint32_t last_byte_us;
    uint8_t received;
    uint8_t response_size, position;
    uint8_t packet[TAXEL_BOOT_PACKET_MAX];
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
};

void taxel_boot_uart_init(struct taxel_boot_uart *uart, struct taxel_boot *boot);
void taxel_boot_uart_on_byte(struct taxel_boot_uart *uart, uint8_t byte);
/* Copy up to `size` bytes of the response to `bytes`; returns their number. */
size_t taxel_boot_uart_pull(struct taxel_boot_uart *uart, uint8_t *bytes, size_t size);
void taxel_boot_uart_run(struct taxel_boot_uart *uart);

/* confirm.c, for applications: confirm the image in `slot` (0 or 1). Writes one row, which takes up to 20 ms, or
 * nothing if the image is already confirmed. Returns 0 or TAXEL_BOOT_ERROR_FLASH. */
int taxel_boot_confirm(const struct taxel_boot_flash *flash, uint8_t slot);
/* Return whether the image in `slot` is confirmed. */
bool taxel_boot_is_confirmed(const struct taxel_boot_flash *flash, uint8_t slot);

#endif
