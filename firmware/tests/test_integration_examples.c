/* The integration examples at the top of the public headers, compiled and run. Make each change here in the header
 * too. */
#include "bootloader/bootloader.h"
#include "check.h"
#include "codec/compact.h"
#include "codec/crc32.h"
#include "codec/deframer.h"
#include "codec/encoder.h"
#include "codec/original.h"
#include "hub/hub.h"
#include "sensor/sensor.h"

#define PASSES 100u

static unsigned frames;
static struct taxel_frame last_frame;

/* Store the last frame and count the frames; handler of the deframer. */
static void on_frame(void *context, const struct taxel_frame *frame)
{
    (void)context;
    last_frame = *frame;
    frames++;
}

/* Run the integration examples of codec/encoder.h and codec/deframer.h. */
static void an_encoded_frame_is_decoded(void)
{
    static const uint8_t payload[TAXEL_HOST_HANDSHAKE_SIZE] = {7, 1, 2};
    uint8_t wire[32];
    const uint16_t payload_size = sizeof payload;
    struct taxel_encoder encoder;
    CHECK(sizeof wire >= taxel_encoded_size_max(payload_size));
    taxel_encoder_begin(&encoder, wire, sizeof wire, 0, TAXEL_FRAME_TYPE_HOST_HANDSHAKE, 0, payload_size);
    taxel_encoder_put(&encoder, payload, payload_size);
    const size_t size = taxel_encoder_end(&encoder);

    static uint8_t chunk[2u * (TAXEL_ENCODED_MAX + 2u)], body[TAXEL_BODY_MAX];
    static const struct taxel_deframer_config config = {
        .chunk = chunk,
        .chunk_capacity = sizeof chunk,
        .body = body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = TAXEL_DIRECTION_TO_HUB,
        .handler = on_frame,
        .context = NULL,
    };
    static struct taxel_deframer deframer;
    frames = 0;
    taxel_deframer_init(&deframer, &config);
    taxel_deframer_push(&deframer, wire, size);
    taxel_deframer_finish(&deframer);
    CHECK_EQUAL(frames, 1);
    CHECK_EQUAL(last_frame.type, TAXEL_FRAME_TYPE_HOST_HANDSHAKE);
    CHECK_EQUAL(last_frame.length, payload_size);
}

static unsigned messages;

/* Check the address and the last count of the example's message. */
static void on_message(void *context, const struct taxel_original_message *message)
{
    (void)context;
    CHECK_EQUAL(message->address, 0x1D);
    CHECK_EQUAL(taxel_original_word(message, 26), 0x0708);
    messages++;
}

/* Run the integration example of codec/original.h. */
static void a_message_of_the_original_hub_is_decoded(void)
{
    uint8_t bytes[62] = {0x01, 62, 0x1D, 0, 0, 0x12, 0x34};
    const size_t size = sizeof bytes;
    bytes[59] = 0x08;
    bytes[60] = 0x07;
    bytes[61] = 0x0A;

    static uint8_t buffer[TAXEL_ORIGINAL_BUFFER_MIN];
    static const struct taxel_original_config config = {
        .buffer = buffer,
        .capacity = sizeof buffer,
        .format = &taxel_format_original,
        .handler = on_message,
        .context = NULL,
    };
    static struct taxel_original_decoder decoder;
    messages = 0;
    int err = taxel_original_init(&decoder, &config);
    taxel_original_push(&decoder, bytes, size);
    taxel_original_finish(&decoder);
    CHECK_EQUAL(err, 0);
    CHECK_EQUAL(messages, 1);
}

/* Run the integration example of codec/compact.h. */
static void counts_coded_against_a_key_frame_are_decoded(void)
{
    enum { n = 3 };
    static const uint16_t key_counts[n] = {1000, 2000, 3000};
    static const uint8_t counts[2 * n] = {0xEA, 0x03, 0xCE, 0x07, 0xB9, 0x0B}; /* 1002, 1998, 3001 */
    taxel_compact_state states[n];
    uint8_t coded[32];
    uint16_t decoded[n];
    size_t size = 0;
    bool is_valid = false;
    for (size_t i = 0; i < n; i++) {
        states[i] = taxel_compact_initial_state(key_counts[i], TAXEL_COMPACT_KEY_FRAME);
    }
    if (taxel_compact_encode(states, counts, n, coded, sizeof coded, &size)) {
        is_valid = taxel_compact_decode(states, n, coded, size, decoded);
    }
    CHECK(is_valid);
    CHECK_EQUAL(decoded[0], 1002);
    CHECK_EQUAL(decoded[2], 3001);
    const uint8_t residual = taxel_compact_residual(states[0], decoded[0]);
    states[0] = taxel_compact_update(states[0], residual, 1);
    CHECK_EQUAL(taxel_compact_centre(states[0]), 1001);
}

static unsigned conversions;
static uint32_t microseconds;

/* Accept scan settings without effect; function of the sensor HAL. */
static void configure(void *context, const struct taxel_scan_settings *settings)
{
    (void)context;
    (void)settings;
}

/* Count the conversions that were started; function of the sensor HAL. */
static void start_conversion(void *context, uint8_t tx, uint8_t rx)
{
    (void)context;
    (void)tx;
    (void)rx;
    conversions++;
}

/* Return a clock that advances by 1 us with each call; function of the sensor and bootloader HAL. */
static uint32_t clock_us_32(void *context)
{
    (void)context;
    return microseconds++;
}

/* Do nothing, because there are no interrupts to mask here; function of the sensor HAL. */
static uint32_t disable_interrupts(void *context)
{
    (void)context;
    return 0;
}

/* Do nothing, because there is no interrupt mask here; function of the sensor HAL. */
static void restore_interrupts(void *context, uint32_t state)
{
    (void)context;
    (void)state;
}

/* Reset the processor (no effect here); function of the HALs. */
static void reset(void *context)
{
    (void)context;
}

/* Run the integration examples of sensor/sensor.h and hal/sensor_hal.h. */
static void a_sensor_board_scans_and_is_read(void)
{
    static const struct taxel_sensor_hal hal = {
        .context = NULL,
        .front_end_configure = configure,
        .conversion_start = start_conversion,
        .clock_us = clock_us_32,
        .interrupts_disable = disable_interrupts,
        .interrupts_restore = restore_interrupts,
        .restart = reset,
        .enter_bootloader = reset,
    };
    static struct taxel_sensor sensor;
    static uint8_t snapshots[3][TAXEL_SNAPSHOT_SIZE(4u)];
    static const uint8_t crossing_map[TAXEL_CROSSING_MAP_SIZE] = {0x0F};
    static const struct taxel_sensor_config config = {
        .hal = &hal,
        .address = 0x20,
        .rows = 2,
        .columns = 2,
        .taxel_count = 4,
        .crossing_map = crossing_map,
        .settings = {.sub_conversions = 100, .sense_clock_divider = 40, .modulator_clock_divider = 1, .idac_code = 96},
        .snapshots = {snapshots[0], snapshots[1], snapshots[2]},
    };
    conversions = 0;
    CHECK_EQUAL(taxel_sensor_init(&sensor, &config), 0);
    taxel_scan_start(&sensor);
    for (uint16_t i = 0; i < 4u; i++) {
        taxel_sensor_run(&sensor);
        taxel_sensor_on_conversion(&sensor, (uint16_t)(1000u + i));
    }
    CHECK_EQUAL(conversions, 5); /* the next scan has started */

    uint8_t bytes[TAXEL_SNAPSHOT_SIZE(4u)];
    CHECK(taxel_sensor_on_address(&sensor, false));
    CHECK(taxel_sensor_on_write(&sensor, TAXEL_REGISTER_SNAPSHOT));
    CHECK(taxel_sensor_on_address(&sensor, true));
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = taxel_sensor_on_read(&sensor);
    }
    taxel_sensor_on_stop(&sensor);
    CHECK_EQUAL(taxel_get_u16(bytes + TAXEL_SNAPSHOT_HEADER_SIZE + 2u * 3u), 1003);
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &config.address, 1), bytes, sizeof bytes - 4u);
    CHECK_EQUAL(taxel_get_u32(bytes + sizeof bytes - 4u), crc);
}

static struct taxel_hub hub;
static uint64_t now_us;
static bool is_transfer_started;

/* Record that an I2C transfer was started; function of the hub HAL. */
static void start_transfer(void *context, const struct taxel_i2c_transfer *transfer)
{
    (void)context;
    (void)transfer;
    is_transfer_started = true;
}

/* Record that the I2C transfer was aborted; function of the hub HAL. */
static void abort_transfer(void *context)
{
    (void)context;
    is_transfer_started = false;
}

/* Set SCL and SDA (no effect here); function of the hub HAL. */
static void drive_lines(void *context, bool scl_high, bool sda_high)
{
    (void)context;
    (void)scl_high;
    (void)sda_high;
}

/* Return the level of SCL or SDA, always high here; function of the hub HAL. */
static bool read_line(void *context)
{
    (void)context;
    return true;
}

/* Return the simulated time in microseconds; function of the hub HAL. */
static uint64_t clock_us(void *context)
{
    (void)context;
    return now_us;
}

/* Advance the simulated time; function of the hub HAL. */
static void delay_us(void *context, uint32_t microseconds_to_wait)
{
    (void)context;
    now_us += microseconds_to_wait;
}

/* Request the next pass of the main loop (no effect here); function of the hub HAL. */
static void set_wake_time(void *context, uint64_t time_us)
{
    (void)context;
    (void)time_us;
}

/* Run the integration examples of hub/hub.h and hal/hub_hal.h. */
static void a_hub_announces_itself_and_scans_the_bus(void)
{
    static const struct taxel_hub_hal hal = {
        .context = NULL,
        .i2c_start = start_transfer,
        .i2c_abort = abort_transfer,
        .i2c_drive = drive_lines,
        .i2c_scl = read_line,
        .i2c_sda = read_line,
        .uart_kick = reset,
        .uart_hold = NULL,
        .clock_us = clock_us,
        .delay_us = delay_us,
        .wake_at = set_wake_time,
        .restart = reset,
        .enter_bootloader = reset,
    };
    static const uint8_t version[3] = {1, 0, 0}, unique_id[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    static struct taxel_hub_slot slots[17];
    static uint8_t pool[2u * TAXEL_HUB_BUFFER_SIZE(TAXEL_COMPACT_SIZE_MAX)], ring[512];
    static const struct taxel_hub_config config = {
        .hal = &hal,
        .firmware_version = version,
        .unique_id = unique_id,
        .scl_hz = 400000u,
        .slots = slots,
        .slot_capacity = 17u,
        .transfer_pool = pool,
        .transfer_pool_size = sizeof pool,
        .transmit_ring = ring,
        .transmit_ring_size = sizeof ring,
    };
    unsigned transfers = 0;
    taxel_hub_init(&hub, &config, TAXEL_RESET_CAUSE_POWER_ON);
    for (unsigned pass = 0; pass < PASSES; pass++) {
        taxel_hub_run(&hub);
        now_us += 100;
        if (is_transfer_started) {
            is_transfer_started = false;
            transfers++;
            taxel_hub_on_i2c_done(&hub, TAXEL_I2C_NACK_ADDRESS);
        }
    }
    CHECK(transfers > PASSES / 2u);

    uint8_t bytes[64];
    taxel_hub_on_uart_byte(&hub, 0);
    CHECK_EQUAL(taxel_hub_uart_pull(&hub, bytes, sizeof bytes), 36); /* HUB_HANDSHAKE */
    CHECK_EQUAL(taxel_hub_uart_pending(&hub), 0);
}

/* Return the simulated flash of a bootloader, 32 KiB. */
static const uint8_t *image_flash(void)
{
    static uint8_t flash[TAXEL_BOOT_ROW_COUNT * TAXEL_BOOT_ROW_SIZE];
    return flash;
}

/* Write one row of the simulated flash; function of the bootloader HAL. Returns 0. */
static int write_row(void *context, uint16_t row, const uint8_t *bytes)
{
    (void)context;
    memcpy((uint8_t *)(uintptr_t)image_flash() + (size_t)row * TAXEL_BOOT_ROW_SIZE, bytes, TAXEL_BOOT_ROW_SIZE);
    return 0;
}

/* Return the cause of the last reset, always power-on here; function of the bootloader HAL. */
static uint8_t read_reset_cause(void *context)
{
    (void)context;
    return TAXEL_RESET_CAUSE_POWER_ON;
}

/* Return whether the application has requested that the bootloader keeps running; function of the bootloader HAL. */
static bool is_stay_requested(void *context)
{
    (void)context;
    return true;
}

/* Start an image (no effect here); function of the bootloader HAL. */
static void start_application(void *context, uint32_t vectors)
{
    (void)context;
    (void)vectors;
}

/* Copy the unique id of the processor, 8 bytes; function of the bootloader HAL. */
static void copy_unique_id(void *context, uint8_t *id)
{
    (void)context;
    memset(id, 0x5A, 8);
}

/* Run the integration examples of bootloader/bootloader.h and hal/boot_hal.h. */
static void a_bootloader_answers_a_packet_and_an_application_confirms(void)
{
    static struct taxel_boot_hal hal = {
        .context = NULL,
        .flash_write_row = write_row,
        .clock_us = clock_us_32,
        .reset_cause = read_reset_cause,
        .stay_requested = is_stay_requested,
        .start = start_application,
        .restart = reset,
        .unique_id = copy_unique_id,
    };
    static struct taxel_boot boot;
    static struct taxel_boot_i2c slave;
    static const struct taxel_boot_config config = {
        .flash = {.hal = &hal, .layout = &taxel_boot_layout_board},
        .checksum = TAXEL_BOOT_CHECKSUM_ANY,
        .version = {1, 0, 0},
    };
    static const uint8_t enter[7] = {0x01, TAXEL_BOOT_COMMAND_ENTER, 0x00, 0x00, 0xC7, 0xFF, 0x17};
    hal.flash = image_flash();
    taxel_boot_init(&boot, &config);
    taxel_boot_i2c_init(&slave, &boot);
    CHECK_EQUAL(taxel_boot_i2c_address(&config.flash), TAXEL_BOOT_DEFAULT_ADDRESS);
    CHECK(taxel_boot_i2c_on_address(&slave, false));
    for (size_t i = 0; i < sizeof enter; i++) {
        CHECK(taxel_boot_i2c_on_write(&slave, enter[i]));
    }
    taxel_boot_i2c_on_stop(&slave);
    taxel_boot_i2c_run(&slave);
    CHECK(taxel_boot_i2c_on_address(&slave, true));
    CHECK_EQUAL(taxel_boot_i2c_on_read(&slave), TAXEL_BOOT_PACKET_START);
    CHECK_EQUAL(taxel_boot_i2c_on_read(&slave), TAXEL_BOOT_STATUS_OK);
    taxel_boot_i2c_on_stop(&slave);
    CHECK_EQUAL(taxel_boot_confirm(&config.flash, 0), 0);
    CHECK(taxel_boot_is_confirmed(&config.flash, 0));
}

int main(void)
{
    RUN(an_encoded_frame_is_decoded);
    RUN(a_message_of_the_original_hub_is_decoded);
    RUN(counts_coded_against_a_key_frame_are_decoded);
    RUN(a_sensor_board_scans_and_is_read);
    RUN(a_hub_announces_itself_and_scans_the_bus);
    RUN(a_bootloader_answers_a_packet_and_an_application_confirms);
    return check_summary();
}
