#include "test_bootloader_bench.h"

#include <string.h>

#include "codec/crc32.h"

#define CHUNK 56u /* a stock tool's bytes in one SEND_DATA: 128 = 56 + 56 + 16 */

/* Write a flash row, and count writes to rows that the bootloader must not change; HAL function of the simulated
 * bootloader. */
static int on_write_row(void *context, uint16_t row, const uint8_t *bytes)
{
    struct bench *const bench = context;
    const struct taxel_boot_layout *const layout = bench->config.flash.layout;
    const bool is_record = row >= TAXEL_BOOT_CONFIGURATION_ROW && row < TAXEL_BOOT_METADATA_ROW + 2u;
    bool is_in_free_slot = false;
    for (unsigned slot = 0; slot < TAXEL_BOOT_SLOTS; slot++) {
        is_in_free_slot |= slot != bench->confirmed && row >= layout->first_rows[slot] &&
                           row < layout->first_rows[slot] + layout->slot_rows;
    }
    bench->forbidden_writes += !is_record && !is_in_free_slot;
    bench->clock_us += FAKE_FLASH_WRITE_US;
    return fake_flash_write_row(&bench->flash, row, bytes);
}

/* Return the simulated time in microseconds; HAL function of the simulated bootloader. */
static uint32_t on_clock(void *context)
{
    return ((struct bench *)context)->clock_us;
}

/* Return the cause of the last reset; HAL function of the simulated bootloader. */
static uint8_t on_reset_cause(void *context)
{
    return ((struct bench *)context)->reset_cause;
}

/* Return true once after the application requested that the bootloader keeps running; HAL function of the simulated
 * bootloader. */
static bool on_stay_requested(void *context)
{
    struct bench *const bench = context;
    const bool requested = bench->stay_flag;
    bench->stay_flag = false;
    return requested;
}

/* Record the slot whose image is started; HAL function of the simulated bootloader. */
static void on_start(void *context, uint32_t vectors)
{
    struct bench *const bench = context;
    const struct taxel_boot_layout *const layout = bench->config.flash.layout;
    for (uint8_t slot = 0; slot < TAXEL_BOOT_SLOTS; slot++) {
        if (vectors == layout->first_rows[slot] * TAXEL_BOOT_ROW_SIZE + TAXEL_BOOT_IMAGE_HEADER_SIZE) {
            bench->running = slot;
        }
    }
}

/* Record the request for a restart; HAL function of the simulated bootloader. */
static void on_restart(void *context)
{
    ((struct bench *)context)->restart_requested = true;
}

/* Copy the unique id of the simulated processor, 8 bytes; HAL function of the simulated bootloader. */
static void on_unique_id(void *context, uint8_t *id)
{
    memcpy(id, ((struct bench *)context)->unique_id, 8);
}

/* Initialise a simulated processor with erased flash and a bootloader for this layout of the flash (board or
 * hub). */
void bench_init(struct bench *bench, const struct taxel_boot_layout *layout, uint64_t seed)
{
    memset(bench, 0, sizeof *bench);
    fake_flash_init(&bench->flash, seed);
    bench->hal = (struct taxel_boot_hal){
        .context = bench,
        .flash = bench->flash.bytes,
        .flash_write_row = on_write_row,
        .clock_us = on_clock,
        .reset_cause = on_reset_cause,
        .stay_requested = on_stay_requested,
        .start = on_start,
        .restart = on_restart,
        .unique_id = on_unique_id,
    };
    bench->config = (struct taxel_boot_config){
        .flash = {&bench->hal, layout},
        .checksum = TAXEL_BOOT_CHECKSUM_ANY,
        .silicon_revision = 0x11,
        .version = {1, 2, 3},
    };
    bench->over_uart = layout->device == TAXEL_BOOT_DEVICE_HUB;
    bench->confirmed = BENCH_NO_SLOT;
    for (uint8_t i = 0; i < 8; i++) {
        bench->unique_id[i] = (uint8_t)random_u64(&bench->flash.random);
    }
    bench_reset(bench, TAXEL_RESET_CAUSE_POWER_ON);
}

/* Reset the simulated processor with this cause and start its bootloader. */
void bench_reset(struct bench *bench, uint8_t cause)
{
    bench->reset_cause = cause;
    bench->running = BENCH_NO_SLOT;
    bench->restart_requested = false;
    bench->clock_us = 0;
    taxel_boot_init(&bench->boot, &bench->config);
    taxel_boot_i2c_init(&bench->i2c, &bench->boot);
    taxel_boot_uart_init(&bench->uart, &bench->boot);
    bench_run(bench);
}

/* Run one pass of the bootloader's main loop; a requested restart takes place. Does nothing while an application
 * runs. */
void bench_run(struct bench *bench)
{
    if (bench->running != BENCH_NO_SLOT) {
        return;
    }
    if (bench->over_uart) {
        taxel_boot_uart_run(&bench->uart);
    } else {
        taxel_boot_i2c_run(&bench->i2c);
    }
    if (bench->restart_requested) {
        bench->restarts++;
        bench_reset(bench, TAXEL_RESET_CAUSE_COMMAND);
    }
}

/* Run the bootloader until its waiting time for a host has passed. */
void bench_settle(struct bench *bench)
{
    bench_run(bench);
    bench->clock_us += TAXEL_BOOT_LISTEN_US;
    bench_run(bench);
}

/* Send bytes to the bootloader by I2C and read its response. Returns the size of the response, 0 if there is
 * none. */
static unsigned exchange_i2c(struct bench *bench, const uint8_t *bytes, unsigned size, uint8_t *response)
{
    unsigned taken = 0;
    bench->refuses_i2c_writes |= !taxel_boot_i2c_on_address(&bench->i2c, false);
    for (unsigned i = 0; i < size && taxel_boot_i2c_on_write(&bench->i2c, bytes[i]); i++) {
    }
    taxel_boot_i2c_on_stop(&bench->i2c);
    bench_run(bench);
    if (!taxel_boot_i2c_on_address(&bench->i2c, true)) {
        return 0;
    }
    for (unsigned i = 0; i < TAXEL_BOOT_PACKET_MAX; i++) {
        response[i] = taxel_boot_i2c_on_read(&bench->i2c);
    }
    taxel_boot_i2c_on_stop(&bench->i2c);
    if (response[0] != 0xFFu) {
        taken = TAXEL_BOOT_PACKET_OVERHEAD + taxel_get_u16(response + 2);
    }
    return taken;
}

/* Send bytes to the bootloader by UART and take its response. Returns the size of the response, 0 if there is
 * none. */
static unsigned exchange_uart(struct bench *bench, const uint8_t *bytes, unsigned size, uint8_t *response)
{
    for (unsigned i = 0; i < size; i++) {
        bench->clock_us += 10;
        taxel_boot_uart_on_byte(&bench->uart, bytes[i]);
        bench_run(bench);
    }
    return (unsigned)taxel_boot_uart_pull(&bench->uart, response, TAXEL_BOOT_PACKET_MAX);
}

/* Send bytes to the bootloader by the selected connection. Returns the size of the response, 0 if there is
 * none. */
unsigned bench_exchange(struct bench *bench, const uint8_t *bytes, unsigned size, uint8_t *response)
{
    if (bench->running != BENCH_NO_SLOT) {
        return 0;
    }
    if (bench->wire) {
        return bench->wire(bench, bytes, size, response);
    }
    return bench->over_uart ? exchange_uart(bench, bytes, size, response) : exchange_i2c(bench, bytes, size, response);
}

/* Return the checksum of a packet of this kind (sum or CRC-16), computed by code that is independent of the
 * bootloader's. */
static unsigned checksum_of(const uint8_t *bytes, unsigned size, uint8_t kind)
{
    unsigned sum = 0, crc = 0xFFFFu;
    if (kind != TAXEL_BOOT_CHECKSUM_CRC) {
        for (unsigned i = 0; i < size; i++) {
            sum += bytes[i];
        }
        return (0x10000u - (sum & 0xFFFFu)) & 0xFFFFu;
    }
    for (unsigned i = 0; i < 8u * size; i++) {
        const unsigned bit = ((unsigned)bytes[i / 8u] >> (i % 8u)) & 1u;
        crc = (crc & 1u) != bit ? (crc >> 1) ^ 0x8408u : crc >> 1;
    }
    crc = ~crc & 0xFFFFu;
    return ((crc & 0xFFu) << 8) | (crc >> 8);
}

/* Build a packet with command and data in `bytes`. Returns its size. */
unsigned bench_packet(const struct bench *bench, uint8_t command, const void *data, unsigned size, uint8_t *bytes)
{
    bytes[0] = 0x01;
    bytes[1] = command;
    taxel_put_u16(bytes + 2, (uint16_t)size);
    if (size) {
        memcpy(bytes + 4, data, size);
    }
    taxel_put_u16(bytes + 4 + size, (uint16_t)checksum_of(bytes, size + 4u, bench->checksum));
    bytes[size + 6u] = 0x17;
    return size + 7u;
}

/* Send a command with `size` bytes of data and check the format of the response. Returns its status, BENCH_NO_REPLY, or
 * BENCH_NOT_A_PACKET; the data of the response are in bench->reply. */
unsigned bench_send(struct bench *bench, uint8_t command, const void *data, unsigned size)
{
    uint8_t packet[TAXEL_BOOT_PACKET_MAX], response[TAXEL_BOOT_PACKET_MAX], expected[TAXEL_BOOT_PACKET_MAX];
    const unsigned packet_size = bench_packet(bench, command, data, size, packet);
    const unsigned taken = bench_exchange(bench, packet, packet_size, response);
    if (taken == 0) {
        return BENCH_NO_REPLY;
    }
    if (taken < TAXEL_BOOT_PACKET_OVERHEAD || taken > TAXEL_BOOT_PACKET_MAX) {
        return BENCH_NOT_A_PACKET;
    }
    bench->reply_size = taken - TAXEL_BOOT_PACKET_OVERHEAD;
    memcpy(bench->reply, response + 4, bench->reply_size);
    (void)bench_packet(bench, response[1], bench->reply, bench->reply_size, expected);
    return memcmp(response, expected, taken) ? BENCH_NOT_A_PACKET : response[1];
}

/* Build a valid image of `rows` flash rows with random content for a slot. */
void bench_make_image(struct bench_image *image, const struct taxel_boot_layout *layout, uint8_t slot, unsigned rows,
                      uint8_t version, uint64_t seed)
{
    struct random_source random;
    random_init(&random, seed, slot);
    memset(image, 0, sizeof *image);
    image->slot = slot;
    image->size = rows * TAXEL_BOOT_ROW_SIZE;
    const unsigned length = rows > 1u ? image->size - 12u : image->size;
    for (unsigned i = TAXEL_BOOT_IMAGE_HEADER_SIZE; i < length; i++) {
        image->bytes[i] = (uint8_t)random_u64(&random);
    }
    struct taxel_boot_image_header header = {
        .magic = TAXEL_BOOT_IMAGE_MAGIC,
        .header_version = TAXEL_BOOT_VERSION,
        .device = layout->device,
        .slot = slot,
        .version_major = version,
        .length = length,
        .vectors = layout->first_rows[slot] * TAXEL_BOOT_ROW_SIZE + TAXEL_BOOT_IMAGE_HEADER_SIZE,
    };
    taxel_boot_image_header_pack(&header, image->bytes);
    header.crc32 = taxel_crc32(taxel_crc32(0, image->bytes, 28), image->bytes + 32, length - 32u);
    taxel_boot_image_header_pack(&header, image->bytes);
}

/* Return the flash content of a slot. */
static uint8_t *slot_bytes(const struct bench *bench, uint8_t slot)
{
    return (uint8_t *)(uintptr_t)bench->hal.flash + bench->config.flash.layout->first_rows[slot] * TAXEL_BOOT_ROW_SIZE;
}

/* Write an image into its slot without the bootloader, and confirms it if `confirmed`. */
void bench_install(struct bench *bench, const struct bench_image *image, bool confirmed)
{
    memcpy(slot_bytes(bench, image->slot), image->bytes, image->size);
    if (confirmed) {
        (void)taxel_boot_confirm(&bench->config.flash, image->slot);
        bench->confirmed = image->slot;
    }
}

/* Return whether the slot of the image contains this image. */
bool bench_holds(const struct bench *bench, const struct bench_image *image)
{
    return memcmp(slot_bytes(bench, image->slot), image->bytes, taxel_get_u32(image->bytes + 12)) == 0;
}

/* Write one flash row with the commands of the bootloader. Returns the first status that is not OK, or OK. */
unsigned bench_program_row(struct bench *bench, uint16_t row, const uint8_t *bytes)
{
    uint8_t last[3 + TAXEL_BOOT_ROW_SIZE - 2u * CHUNK] = {0, (uint8_t)row, (uint8_t)(row >> 8)};
    unsigned status = bench_send(bench, TAXEL_BOOT_COMMAND_SEND_DATA, bytes, CHUNK);
    if (status == 0) {
        status = bench_send(bench, TAXEL_BOOT_COMMAND_SEND_DATA, bytes + CHUNK, CHUNK);
    }
    if (status == 0) {
        memcpy(last + 3, bytes + 2u * CHUNK, sizeof last - 3u);
        status = bench_send(bench, TAXEL_BOOT_COMMAND_PROGRAM_ROW, last, sizeof last);
    }
    return status;
}

/* Compare the checksum of one flash row, as the command VERIFY_ROW reports it, with that of `bytes`. Returns 0 if they
 * agree, the status of the command if it fails, otherwise BENCH_NO_SLOT + 1. */
static unsigned check_row(struct bench *bench, uint16_t row, const uint8_t *bytes)
{
    const uint8_t address[3] = {0, (uint8_t)row, (uint8_t)(row >> 8)};
    unsigned sum = 0;
    const unsigned status = bench_send(bench, TAXEL_BOOT_COMMAND_VERIFY_ROW, address, sizeof address);
    for (unsigned i = 0; i < TAXEL_BOOT_ROW_SIZE; i++) {
        sum += bytes[i];
    }
    return status ? status : (uint8_t)(bench->reply[0] + sum) == 0 ? 0u : BENCH_NO_SLOT + 1u;
}

/* Write an image with the commands of the bootloader, as a host does. Returns the first status that is not OK, or
 * OK. */
unsigned bench_program(struct bench *bench, const struct bench_image *image)
{
    const uint8_t array = 0;
    const unsigned first = bench->config.flash.layout->first_rows[image->slot];
    unsigned status = bench_send(bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0);
    if (status == 0) {
        status = bench_send(bench, TAXEL_BOOT_COMMAND_GET_FLASH_SIZE, &array, 1);
    }
    if (status == 0 && (taxel_get_u16(bench->reply) > first ||
                        taxel_get_u16(bench->reply + 2) + 1u < first + image->size / TAXEL_BOOT_ROW_SIZE)) {
        return BENCH_NO_SLOT + 1u;
    }
    for (unsigned i = 0; i < image->size / TAXEL_BOOT_ROW_SIZE && status == 0; i++) {
        const uint8_t *const bytes = image->bytes + i * TAXEL_BOOT_ROW_SIZE;
        status = bench_program_row(bench, (uint16_t)(first + i), bytes);
        if (status == 0) {
            status = check_row(bench, (uint16_t)(first + i), bytes);
        }
    }
    if (status == 0) {
        status = bench_send(bench, TAXEL_BOOT_COMMAND_VERIFY_APPLICATION, NULL, 0);
    }
    if (status == 0 && (bench->reply_size != 1 || bench->reply[0] != 1)) {
        return BENCH_NO_SLOT + 1u;
    }
    if (status == 0 && bench_send(bench, TAXEL_BOOT_COMMAND_EXIT, NULL, 0) != BENCH_NO_REPLY) {
        return BENCH_NOT_A_PACKET;
    }
    return status;
}
