/* Slot selection of the bootloader on a flash in RAM: two small slots and the rows of configuration and metadata. */
#include "bootloader/internal.h"
#include "codec/crc32.h"
#include "image.h"

#define ROW TAXEL_BOOT_ROW_SIZE
#define SLOT_ROWS 4u
#define FIRST_ROW (TAXEL_BOOT_CONFIGURATION_ROW - 2u * SLOT_ROWS)
#define ROWS (TAXEL_BOOT_ROW_COUNT - FIRST_ROW)
#define NO_SLOT_STARTED 0xFFu

static uint8_t rows[ROWS * ROW];
static uint32_t clock_us, writes;
static uint8_t cause, started;
static bool stay_requested, write_fails;
static struct taxel_boot boot;

static const struct taxel_boot_layout layout = {
    .device = TAXEL_BOOT_DEVICE_BOARD, .slot_rows = SLOT_ROWS, .first_rows = {FIRST_ROW, FIRST_ROW + SLOT_ROWS}};

/* Return the bytes of flash row `row`, FIRST_ROW or a later one, in the emulated flash. */
static uint8_t *row_at(unsigned row)
{
    return rows + (row - FIRST_ROW) * ROW;
}

/* HAL function of the bootloader: store a row of the emulated flash. Fails while `write_fails` is set, and for rows
 * below the first slot. */
static int on_write_row(void *context, uint16_t row, const uint8_t *bytes)
{
    (void)context;
    writes++;
    if (row < FIRST_ROW || write_fails) {
        return -1;
    }
    memcpy(row_at(row), bytes, ROW);
    return 0;
}

/* HAL function of the bootloader: return the time that the test has set. */
static uint32_t on_clock(void *context)
{
    (void)context;
    return clock_us;
}

/* HAL function of the bootloader: return the reset cause that the test has set. */
static uint8_t on_cause(void *context)
{
    (void)context;
    return cause;
}

/* HAL function of the bootloader: return once whether the application has requested that the bootloader stays. */
static bool on_stay(void *context)
{
    (void)context;
    const bool requested = stay_requested;
    stay_requested = false;
    return requested;
}

/* HAL function of the bootloader: record the slot in which the vector table of the started image lies. */
static void on_start(void *context, uint32_t vectors)
{
    (void)context;
    started = vectors / ROW >= layout.first_rows[1];
}

/* HAL function of the bootloader: a restart has no effect in this program. */
static void on_restart(void *context)
{
    (void)context;
}

/* HAL function of the bootloader: write an arbitrary constant identifier of eight bytes. */
static void on_unique_id(void *context, uint8_t *id)
{
    (void)context;
    memset(id, 0x5A, 8);
}

static struct taxel_boot_hal hal = {
    .flash_write_row = on_write_row,
    .clock_us = on_clock,
    .reset_cause = on_cause,
    .stay_requested = on_stay,
    .start = on_start,
    .restart = on_restart,
    .unique_id = on_unique_id,
};
static struct taxel_boot_config config = {.flash = {&hal, &layout}, .checksum = TAXEL_BOOT_CHECKSUM_ANY};

/* Write an image of 300 bytes with a valid header and CRC to a slot. */
static void install_image(uint8_t slot, uint8_t version)
{
    uint8_t *const image = row_at(layout.first_rows[slot]);
    struct taxel_boot_image_header header = {
        .magic = TAXEL_BOOT_IMAGE_MAGIC,
        .header_version = TAXEL_BOOT_VERSION,
        .device = TAXEL_BOOT_DEVICE_BOARD,
        .slot = slot,
        .version_major = version,
        .length = 300,
        .vectors = layout.first_rows[slot] * ROW + TAXEL_BOOT_IMAGE_HEADER_SIZE,
    };
    for (unsigned i = TAXEL_BOOT_IMAGE_HEADER_SIZE; i < header.length; i++) {
        image[i] = (uint8_t)(version * 31u + i * 7u);
    }
    taxel_boot_image_header_pack(&header, image);
    header.crc32 = taxel_crc32(taxel_crc32(0, image, TAXEL_BOOT_IMAGE_HEADER_OFFSET_CRC32),
                               image + TAXEL_BOOT_IMAGE_HEADER_SIZE, header.length - TAXEL_BOOT_IMAGE_HEADER_SIZE);
    taxel_boot_image_header_pack(&header, image);
}

/* FNV-1a hash of the flash. A CRC would be constant over rows that end in their own CRC. */
static uint32_t hash_flash(void)
{
    uint32_t value = 0x811C9DC5u;
    for (unsigned i = 0; i < sizeof rows; i++) {
        value = (value ^ rows[i]) * 0x01000193u;
    }
    return value;
}

/* Start the bootloader with a reset cause. Print the slot that it starts before and after the time in which it listens
 * for a host, and the metadata afterwards. */
static void report_start(const char *description, uint8_t with_cause)
{
    put_text(description);
    put_text("\n");
    cause = with_cause;
    clock_us = 0;
    started = NO_SLOT_STARTED;
    taxel_boot_init(&boot, &config);
    taxel_boot_run(&boot);
    put_word("  before listening", started);
    clock_us = TAXEL_BOOT_LISTEN_US;
    taxel_boot_run(&boot);
    put_word("  after listening", started);
    put_word("  stays", boot.stay);
    put_word("  kept slot", taxel_boot_kept_slot(&config.flash));
    put_word("  rows written", writes);
    put_word("  flash", hash_flash());
}

/* Start the bootloader in every state of the two slots (empty, unconfirmed, confirmed, on trial, damaged, not writable)
 * and print the slot that it selects. */
int main(void)
{
    uintptr_t begin = (uintptr_t)rows - FIRST_ROW * ROW; /* the rows before FIRST_ROW are never accessed */
    __asm__("" : "+r"(begin));                           /* hides the invalid address from the compiler */
    hal.flash = (const uint8_t *)begin;
    report_start("empty flash", TAXEL_RESET_CAUSE_POWER_ON);
    install_image(0, 1);
    report_start("one unconfirmed image", TAXEL_RESET_CAUSE_POWER_ON);
    put_word("confirm", (uint32_t)taxel_boot_confirm(&config.flash, 0));
    report_start("confirmed image", TAXEL_RESET_CAUSE_COMMAND);
    install_image(1, 2);
    report_start("second image installed", TAXEL_RESET_CAUSE_POWER_ON);
    put_word("pending", (uint32_t)taxel_boot_metadata_set_pending(&config.flash, 1));
    for (unsigned i = 0; i <= TAXEL_BOOT_TRIES; i++) {
        report_start("on trial", TAXEL_RESET_CAUSE_WATCHDOG);
    }
    put_word("pending", (uint32_t)taxel_boot_metadata_set_pending(&config.flash, 1));
    row_at(layout.first_rows[1])[200] ^= 1u; /* one wrong bit: the CRC of the image does not match */
    report_start("damaged image", TAXEL_RESET_CAUSE_COMMAND);
    row_at(layout.first_rows[1])[200] ^= 1u;
    write_fails = true;
    report_start("trial that cannot be recorded", TAXEL_RESET_CAUSE_COMMAND);
    write_fails = false;
    stay_requested = true;
    report_start("stay requested", TAXEL_RESET_CAUSE_COMMAND);
    report_start("image repaired", TAXEL_RESET_CAUSE_COMMAND);
    put_word("confirm", (uint32_t)taxel_boot_confirm(&config.flash, 1));
    row_at(layout.first_rows[1])[100] ^= 4u;
    report_start("fallback to the previous image", TAXEL_RESET_CAUSE_POWER_ON);
    return 0;
}
