#include "emulator/boot_node.h"

#include <stdio.h>
#include <string.h>

#include "codec/crc32.h"
#include "emulator/psoc4/parts.h"

#define VECTORS_SIZE 8u /* stack pointer and reset vector; the factory image contains no more */
#define HANG "HANG"
#define PACKET_TIME (200u * VTIME_US) /* estimate: checksum and response of a packet at 24 MHz */
#define VERIFY_TIME (12u * VTIME_MS)  /* estimate: CRC-32 of 12 KiB, four bits at a time */
#define SLOT_A 0u

/* Write one flash row; HAL function of the emulated bootloader. The board is busy until the virtual time at which the
 * write ends. Returns 0. */
static int on_write_row(void *context, uint16_t row, const uint8_t *bytes)
{
    struct boot_node *boot = context;
    boot->busy_until = flash_write_row(&boot->flash, row, bytes, vtime_max(boot->now, boot->busy_until));
    return 0;
}

/* Return the time since the last reset in microseconds, modulo 2^32; HAL function of the emulated bootloader. */
static uint32_t on_clock_us(void *context)
{
    const struct boot_node *boot = context;
    return (uint32_t)((boot->now - boot->reset_at) / VTIME_US);
}

/* Return the cause of the last reset; HAL function of the emulated bootloader. The cause is changed so that the
 * bootloader waits for a host only in worlds with `boot_listens 1` or after a watchdog reset. */
static uint8_t on_reset_cause(void *context)
{
    const struct boot_node *boot = context;
    /* After a reset by command the bootloader does not wait 100 ms for a host. */
    return boot->listens || boot->reset_cause == TAXEL_RESET_CAUSE_WATCHDOG ? boot->reset_cause
                                                                            : TAXEL_RESET_CAUSE_COMMAND;
}

/* Return true once after the application has requested that the bootloader keeps running; HAL function of the emulated
 * bootloader. */
static bool on_stay_requested(void *context)
{
    struct boot_node *boot = context;
    const bool stay_requested = boot->stay_requested;
    boot->stay_requested = false;
    return stay_requested;
}

/* Start the image with this vector table, whose address identifies the slot; HAL function of the emulated
 * bootloader. */
static void on_start(void *context, uint32_t vectors)
{
    struct boot_node *boot = context;
    const uint32_t slot_b = (uint32_t)boot->config.flash.layout->first_rows[1] * FLASH_ROW_SIZE;
    boot->slot = vectors >= slot_b;
    boot->start_requested = true;
}

/* Request a restart, which the event loop makes; HAL function of the emulated bootloader. */
static void on_restart(void *context)
{
    ((struct boot_node *)context)->restart_requested = true;
}

/* Copy the unique id of the processor, 8 bytes, to `id`; HAL function of the emulated bootloader. */
static void on_unique_id(void *context, uint8_t *id)
{
    const struct boot_node *boot = context;
    memcpy(id, boot->unique_id, sizeof boot->unique_id);
}

/* Return the flash content of `slot` (0 or 1). */
static uint8_t *get_slot_bytes(struct boot_node *boot, uint8_t slot)
{
    return boot->flash.bytes + (size_t)boot->config.flash.layout->first_rows[slot] * FLASH_ROW_SIZE;
}

/* Write an image with a valid header and CRC into slot A, as after production. It contains only a vector table, because
 * the emulator does not execute it. */
static void store_factory_image(struct boot_node *boot, const uint8_t version[3])
{
    const struct taxel_boot_layout *const layout = boot->config.flash.layout;
    uint8_t *const image = get_slot_bytes(boot, SLOT_A);
    const uint32_t length = TAXEL_BOOT_IMAGE_HEADER_SIZE + VECTORS_SIZE;
    const struct taxel_boot_image_header header = {
        .magic = TAXEL_BOOT_IMAGE_MAGIC,
        .header_version = TAXEL_BOOT_VERSION,
        .device = layout->device,
        .slot = SLOT_A,
        .version_major = version[0],
        .version_minor = version[1],
        .version_patch = version[2],
        .length = length,
        .vectors = (uint32_t)layout->first_rows[SLOT_A] * FLASH_ROW_SIZE + TAXEL_BOOT_IMAGE_HEADER_SIZE,
    };
    taxel_boot_image_header_pack(&header, image);
    const uint32_t header_crc = taxel_crc32(0, image, TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32);
    taxel_put_u32(image + TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32,
                  taxel_crc32(header_crc, image + TAXEL_BOOT_IMAGE_HEADER_SIZE, VECTORS_SIZE));
}

/* Return the flash row of a record. `row`: the row on a part with 32 KiB of flash; on a larger part, the row has the
 * same distance from the end of the flash. */
static uint16_t record_row(const struct boot_node *boot, uint16_t row)
{
    const uint32_t rows = boot->flash.size / FLASH_ROW_SIZE;
    return (uint16_t)(rows > TAXEL_BOOT_ROW_COUNT ? row + rows - TAXEL_BOOT_ROW_COUNT : row);
}

/* Write the board's configuration record, format version 1: I2C address, kind of board, and a serial number of at most
 * 16 bytes derived from the unique id. */
static void store_factory_configuration(struct boot_node *boot, const struct board_description *description)
{
    uint8_t bytes[TAXEL_BOOT_CONFIGURATION_SIZE] = {0};
    bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_VERSION] = 1;
    bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS] = description->address;
    bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] = description->kind;
    snprintf((char *)bytes + TAXEL_BOOT_CONFIGURATION_OFFSET_SERIAL_NUMBER, 16, "T%02X%02X%02X%02X",
             description->unique_id[0], description->unique_id[1], description->unique_id[2],
             description->unique_id[3]);
    (void)taxel_boot_record_write(&boot->config.flash, record_row(boot, TAXEL_BOOT_CONFIGURATION_ROW),
                                  TAXEL_BOOT_CONFIGURATION_MAGIC, bytes, sizeof bytes);
}

/* Initialise the bootloader of a board or of the hub with an erased flash. `boot_ms`: total boot time in milliseconds,
 * of which the bootloader takes at most half. `part`: the emulated chip, if the device executes an image; NULL
 * otherwise, which selects a flash of 32 KiB. */
static void init_common(struct boot_node *boot, const struct world_description *world,
                        const struct taxel_boot_layout *layout, const struct psoc_part *part,
                        const uint8_t unique_id[8], double boot_ms)
{
    memset(boot, 0, sizeof *boot);
    flash_init(&boot->flash, part ? part->flash_size : TAXEL_BOOT_ROW_COUNT * FLASH_ROW_SIZE, world->seed,
               unique_id[0]);
    memcpy(boot->unique_id, unique_id, sizeof boot->unique_id);
    boot->listens = world->boot_listens;
    boot->init_time = vtime_min(BOOT_NODE_INIT_TIME, (vtime)(boot_ms * (double)VTIME_MS) / 2u);
    boot->hal = (struct taxel_boot_hal){
        .context = boot,
        .flash = boot->flash.bytes,
        .flash_write_row = on_write_row,
        .clock_us = on_clock_us,
        .reset_cause = on_reset_cause,
        .stay_requested = on_stay_requested,
        .start = on_start,
        .restart = on_restart,
        .unique_id = on_unique_id,
    };
    boot->config = (struct taxel_boot_config){
        .flash = {.hal = &boot->hal, .layout = layout},
        .checksum = TAXEL_BOOT_CHECKSUM_ANY,
        .version = WORLD_FIRMWARE_VERSION,
    };
}

/* Confirm the factory image. Writes during production do not count as wear, and no power cut can tear them. */
static void finish_production(struct boot_node *boot)
{
    static const uint8_t confirmed[TAXEL_BOOT_METADATA_SIZE] = {SLOT_A, TAXEL_BOOT_SLOT_NONE, TAXEL_BOOT_TRIES,
                                                                TAXEL_BOOT_TRIES};
    (void)taxel_boot_record_write(&boot->config.flash, record_row(boot, TAXEL_BOOT_METADATA_ROW),
                                  TAXEL_BOOT_METADATA_MAGIC, confirmed, sizeof confirmed);
    memset(boot->flash.wear, 0, sizeof boot->flash.wear);
    boot->flash.pending_count = 0;
    boot->flash.write_count = 0;
    boot->busy_until = 0;
}

/* Initialise flash and bootloader of a board: the image of the world file, or a factory image; a blank board has no
 * configuration. */
void boot_node_init(struct boot_node *boot, const struct world_description *world,
                    const struct board_description *description)
{
    init_common(boot, world, &taxel_boot_layout_board, description->part, description->unique_id, description->boot_ms);
    if (description->image) {
        memcpy(boot->flash.bytes, description->image, WORLD_IMAGE_SIZE);
    }
    if (!description->is_blank) {
        if (!description->image) {
            store_factory_image(boot, description->firmware_version);
        }
        store_factory_configuration(boot, description);
        finish_production(boot);
    }
}

/* Initialise flash and bootloader of the hub. */
void boot_node_init_hub(struct boot_node *boot, const struct world_description *world, const uint8_t unique_id[8])
{
    static const uint8_t version[3] = WORLD_FIRMWARE_VERSION;
    init_common(boot, world, &taxel_boot_layout_hub, world->hub_part, unique_id, 0.0);
    boot->is_hub = true;
    if (world->hub_image) {
        memcpy(boot->flash.bytes, world->hub_image, WORLD_IMAGE_SIZE);
    } else {
        store_factory_image(boot, version);
    }
    finish_production(boot);
}

/* Return whether the code of the started image begins with the characters HANG: such an image emulates one that does
 * not respond. */
static bool is_hanging_image(struct boot_node *boot)
{
    const uint8_t *const image = get_slot_bytes(boot, boot->slot);
    return memcmp(image + TAXEL_BOOT_IMAGE_HEADER_SIZE + VECTORS_SIZE, HANG, sizeof HANG - 1u) == 0;
}

/* Run one pass of the bootloader's main loop at virtual time `now`. The node is then busy for the time that packet, CRC
 * check or flash write takes. Byte 1 of a packet is its command. Returns what happens next. */
enum boot_outcome boot_node_run(struct boot_node *boot, vtime now)
{
    const bool has_packet = boot->is_hub ? boot->uart.has_packet : boot->i2c.has_packet;
    const uint8_t command = boot->is_hub ? boot->uart.packet[1] : boot->i2c.packet[1];
    boot->now = vtime_max(now, boot->busy_until);
    if (boot->is_hub) {
        taxel_boot_uart_run(&boot->uart);
    } else {
        taxel_boot_i2c_run(&boot->i2c);
    }
    if (has_packet) {
        const bool verifies = command == TAXEL_BOOT_COMMAND_VERIFY_APPLICATION || command == TAXEL_BOOT_COMMAND_ENTER;
        boot->busy_until = vtime_max(boot->busy_until, boot->now + (verifies ? VERIFY_TIME : PACKET_TIME));
    }
    boot->now = vtime_max(boot->now, boot->busy_until);
    if (boot->restart_requested) {
        boot->restart_requested = false;
        return BOOT_RESTARTS;
    }
    if (boot->start_requested) {
        boot->start_requested = false;
        return is_hanging_image(boot) ? BOOT_STARTS_HANGING_IMAGE : BOOT_STARTS_IMAGE;
    }
    return BOOT_STAYS_IN_BOOTLOADER;
}

/* Return the virtual time at which the bootloader stops waiting for a host; VTIME_NEVER if it is not waiting. */
vtime boot_node_next_deadline(const struct boot_node *boot)
{
    return boot->boot.stay == TAXEL_BOOT_STAY_LISTENING ? boot->reset_at + (TAXEL_BOOT_LISTEN_US + 1u) * VTIME_US
                                                        : VTIME_NEVER;
}

/* Reset the bootloader at virtual time `now`; it starts after its initialisation time. Returns what happens next. */
enum boot_outcome boot_node_reset(struct boot_node *boot, vtime now, uint8_t reset_cause)
{
    boot->reset_cause = reset_cause;
    boot->reset_at = boot->now = now + boot->init_time;
    boot->busy_until = 0;
    boot->start_requested = boot->restart_requested = false;
    taxel_boot_init(&boot->boot, &boot->config);
    taxel_boot_i2c_init(&boot->i2c, &boot->boot);
    taxel_boot_uart_init(&boot->uart, &boot->boot);
    return boot_node_run(boot, boot->now);
}

/* Remove the power at the virtual time `now`: a flash write in progress is interrupted. */
void boot_node_power_off(struct boot_node *boot, vtime now)
{
    flash_cut_power(&boot->flash, now);
    boot->stay_requested = false;
}

/* Return the firmware version in the header of the started image: 3 bytes, major, minor, patch. */
const uint8_t *boot_node_get_version(const struct boot_node *boot)
{
    return boot->flash.bytes + (size_t)boot->config.flash.layout->first_rows[boot->slot] * FLASH_ROW_SIZE +
           TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR;
}

/* Return the 7-bit I2C address in the configuration of the board; 0x77 without a configuration. */
uint8_t boot_node_get_address(const struct boot_node *boot)
{
    return taxel_boot_i2c_address(&boot->config.flash);
}

/* Return the kind (design) of the board in its configuration; 0 without a configuration. */
uint8_t boot_node_get_kind(const struct boot_node *boot)
{
    const uint8_t *const configuration = taxel_boot_configuration(&boot->config.flash);
    return configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] : 0;
}

/* Write the confirmation of the running image to flash. Returns the virtual time at which the write ends, or 0 if the
 * image is confirmed already. */
vtime boot_node_confirm_image(struct boot_node *boot, vtime now)
{
    if (taxel_boot_is_confirmed(&boot->config.flash, boot->slot)) {
        return 0;
    }
    boot->now = now;
    boot->busy_until = 0;
    (void)taxel_boot_confirm(&boot->config.flash, boot->slot);
    return boot->busy_until;
}
