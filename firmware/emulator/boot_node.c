#include "emulator/boot_node.h"

#include <stdio.h>
#include <string.h>

#include "bootloader/parts.h"
#include "codec/crc32.h"

#define VECTORS 8u   /* bytes: stack pointer and reset vector; images of a factory have no more */
#define HANG "HANG"
#define PACKET_TIME (200u * VTIME_US)     /* estimate: a packet's checksum and its answer at 24 MHz */
#define VERIFY_TIME (12u * VTIME_MS)      /* estimate: CRC-32 of 12 KiB, nibble by nibble */
#define SLOT_A 0u

static int on_write_row(void *context, uint16_t row, const uint8_t *bytes)
{
    struct boot_node *boot = context;
    boot->busy_until = flash_write(&boot->flash, row, bytes, vtime_max(boot->now, boot->busy_until));
    return 0;
}

static uint32_t on_clock_us(void *context)
{
    const struct boot_node *boot = context;
    return (uint32_t)((boot->now - boot->reset_at) / VTIME_US);
}

static uint8_t on_reset_cause(void *context)
{
    const struct boot_node *boot = context;
    /* Where nobody waits for the 100 ms, every reset is as one on command. */
    return boot->listens || boot->cause == TAXEL_RESET_CAUSE_WATCHDOG ? boot->cause : TAXEL_RESET_CAUSE_COMMAND;
}

static bool on_stay_requested(void *context)
{
    struct boot_node *boot = context;
    const bool stay = boot->stay;
    boot->stay = false;
    return stay;
}

static void on_start(void *context, uint32_t vectors)
{
    struct boot_node *boot = context;
    const uint32_t second = (uint32_t)boot->config.flash.layout->first_rows[1] * FLASH_ROW;
    boot->slot = vectors >= second;
    boot->wants_start = true;
}

static void on_restart(void *context)
{
    ((struct boot_node *)context)->wants_restart = true;
}

static void on_unique_id(void *context, uint8_t *id)
{
    const struct boot_node *boot = context;
    memcpy(id, boot->unique_id, sizeof boot->unique_id);
}

static uint8_t *slot_bytes(struct boot_node *boot, uint8_t slot)
{
    return boot->flash.bytes + (size_t)boot->config.flash.layout->first_rows[slot] * FLASH_ROW;
}

static void store_factory_image(struct boot_node *boot, const uint8_t version[3])
{
    const struct taxel_boot_layout *const layout = boot->config.flash.layout;
    uint8_t *const image = slot_bytes(boot, SLOT_A);
    const uint32_t length = TAXEL_BOOT_IMAGE_HEADER_SIZE + VECTORS;
    const struct taxel_boot_image_header header = {
        .magic = TAXEL_BOOT_IMAGE_MAGIC,
        .header_version = TAXEL_BOOT_VERSION,
        .device = layout->device,
        .slot = SLOT_A,
        .version_major = version[0],
        .version_minor = version[1],
        .version_patch = version[2],
        .length = length,
        .vectors = (uint32_t)layout->first_rows[SLOT_A] * FLASH_ROW + TAXEL_BOOT_IMAGE_HEADER_SIZE,
    };
    taxel_boot_image_header_pack(&header, image);
    const uint32_t head = taxel_crc32(0, image, TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32);
    taxel_put_u32(image + TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32,
                  taxel_crc32(head, image + TAXEL_BOOT_IMAGE_HEADER_SIZE, VECTORS));
}

static void store_factory_configuration(struct boot_node *boot, const struct board_description *description)
{
    uint8_t bytes[TAXEL_BOOT_CONFIGURATION_SIZE] = {0};
    bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_VERSION] = 1;
    bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_ADDRESS] = description->address;
    bytes[TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] = description->kind;
    snprintf((char *)bytes + TAXEL_BOOT_CONFIGURATION_OFFSET_SERIAL_NUMBER, 16, "T%02X%02X%02X%02X", description->unique_id[0],
             description->unique_id[1], description->unique_id[2], description->unique_id[3]);
    (void)taxel_boot_record_write(&boot->config.flash, TAXEL_BOOT_CONFIGURATION_ROW, TAXEL_BOOT_CONFIGURATION_MAGIC, bytes,
                                  sizeof bytes);
}

static void prepare(struct boot_node *boot, const struct world_description *world, const struct taxel_boot_layout *layout,
                    const uint8_t unique_id[8], double boot_ms)
{
    memset(boot, 0, sizeof *boot);
    flash_init(&boot->flash, world->seed, unique_id[0]);
    memcpy(boot->unique_id, unique_id, sizeof boot->unique_id);
    boot->listens = world->boot_listens;
    boot->init_time = vtime_min(BOOT_NODE_INIT, (vtime)(boot_ms * (double)VTIME_MS) / 2u);
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

/* What the factory did has worn nothing, and cannot be cut any more. */
static void leave_the_factory(struct boot_node *boot)
{
    (void)taxel_boot_confirm(&boot->config.flash, SLOT_A);
    memset(boot->flash.wear, 0, sizeof boot->flash.wear);
    boot->flash.count = 0;
    boot->flash.operations = 0;
    boot->busy_until = 0;
}

void boot_node_init(struct boot_node *boot, const struct world_description *world,
                    const struct board_description *description)
{
    prepare(boot, world, &taxel_boot_layout_board, description->unique_id, description->boot_ms);
    if (description->image) {
        memcpy(boot->flash.bytes, description->image, sizeof boot->flash.bytes);
    }
    if (!description->is_blank) {
        if (!description->image) {
            store_factory_image(boot, description->firmware_version);
        }
        store_factory_configuration(boot, description);
        leave_the_factory(boot);
    }
}

void boot_node_init_hub(struct boot_node *boot, const struct world_description *world, const uint8_t unique_id[8])
{
    static const uint8_t version[3] = WORLD_FIRMWARE_VERSION;
    prepare(boot, world, &taxel_boot_layout_hub, unique_id, 0.0);
    boot->is_hub = true;
    if (world->hub_image) {
        memcpy(boot->flash.bytes, world->hub_image, sizeof boot->flash.bytes);
    } else {
        store_factory_image(boot, version);
    }
    leave_the_factory(boot);
}

static bool image_hangs(struct boot_node *boot)
{
    const uint8_t *const image = slot_bytes(boot, boot->slot);
    return memcmp(image + TAXEL_BOOT_IMAGE_HEADER_SIZE + VECTORS, HANG, sizeof HANG - 1u) == 0;
}

enum boot_node_outcome boot_node_run(struct boot_node *boot, vtime now)
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
    if (boot->wants_restart) {
        boot->wants_restart = false;
        return BOOT_NODE_RESTARTS;
    }
    if (boot->wants_start) {
        boot->wants_start = false;
        return image_hangs(boot) ? BOOT_NODE_HANGS : BOOT_NODE_STARTS;
    }
    return BOOT_NODE_STAYS;
}

vtime boot_node_deadline(const struct boot_node *boot)
{
    return boot->boot.stay == TAXEL_BOOT_STAY_LISTENING ? boot->reset_at + (TAXEL_BOOT_LISTEN_US + 1u) * VTIME_US : VTIME_NEVER;
}

enum boot_node_outcome boot_node_reset(struct boot_node *boot, vtime now, uint8_t cause)
{
    boot->cause = cause;
    boot->reset_at = boot->now = now + boot->init_time;
    boot->busy_until = 0;
    boot->wants_start = boot->wants_restart = false;
    taxel_boot_init(&boot->boot, &boot->config);
    taxel_boot_i2c_init(&boot->i2c, &boot->boot);
    taxel_boot_uart_init(&boot->uart, &boot->boot);
    return boot_node_run(boot, boot->now);
}

void boot_node_power_off(struct boot_node *boot, vtime now)
{
    flash_cut(&boot->flash, now);
    boot->stay = false;
}

const uint8_t *boot_node_version(const struct boot_node *boot)
{
    return boot->flash.bytes + (size_t)boot->config.flash.layout->first_rows[boot->slot] * FLASH_ROW +
           TAXEL_BOOT_IMAGE_HEADER_OFFSET_VERSION_MAJOR;
}

uint8_t boot_node_address(const struct boot_node *boot)
{
    return taxel_boot_i2c_address(&boot->config.flash);
}

uint8_t boot_node_kind(const struct boot_node *boot)
{
    const uint8_t *const configuration = taxel_boot_configuration(&boot->config.flash);
    return configuration ? configuration[TAXEL_BOOT_CONFIGURATION_OFFSET_KIND] : 0;
}

vtime boot_node_confirm(struct boot_node *boot, vtime now)
{
    if (taxel_boot_is_confirmed(&boot->config.flash, boot->slot)) {
        return 0;
    }
    boot->now = now;
    boot->busy_until = 0;
    (void)taxel_boot_confirm(&boot->config.flash, boot->slot);
    return boot->busy_until;
}
