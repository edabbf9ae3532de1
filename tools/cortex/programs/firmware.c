/* Firmware of this repository: frames pass the encoder and, partly damaged, the deframer; a board scans and serves its
 * registers with a HAL without hardware. */
#include <string.h>

#include "codec/crc32.h"
#include "codec/deframer.h"
#include "codec/encoder.h"
#include "image.h"
#include "sensor/sensor.h"

#define FRAMES 40u
#define ROWS 8u
#define COLUMNS 8u
#define TAXELS (ROWS * COLUMNS)
#define PAYLOAD_MAX (TAXEL_TAXEL_HEADER_SIZE + TAXEL_SNAPSHOT_OVERHEAD + 2u * TAXELS)

static uint32_t state = 7, checksum;
static uint8_t wire[400], chunk[1024], body[9 + PAYLOAD_MAX];
static uint8_t snapshots[3][TAXEL_SNAPSHOT_SIZE(TAXELS)], crossing_map[TAXEL_CROSSING_MAP_SIZE];
static unsigned started;
static struct taxel_sensor sensor;

/* Return the next number of the generator xorshift32 (Marsaglia, 2003): the same on every processor. */
static uint32_t next_random(void)
{
    state ^= state << 13;
    state ^= state >> 17;
    return state ^= state << 5;
}

/* Called by the deframer for each frame that it finds: add the frame to the checksum. */
static void on_frame(void *context, const struct taxel_frame *frame)
{
    (void)context;
    checksum = taxel_crc32(checksum, frame->payload, frame->length) + frame->sequence + frame->type;
}

/* Encode random taxel frames and pass them to the deframer, every fourth with one flipped bit; print a checksum of the
 * frames and the number found and discarded. */
static void test_frames(void)
{
    struct taxel_deframer deframer;
    const struct taxel_deframer_config config = {
        .chunk = chunk,
        .chunk_capacity = sizeof chunk,
        .body = body,
        .payload_max = PAYLOAD_MAX,
        .directions = TAXEL_DIRECTION_TO_HOST | TAXEL_DIRECTION_TO_HUB,
        .handler = on_frame,
    };
    taxel_deframer_init(&deframer, &config);
    for (unsigned i = 0; i < FRAMES; i++) {
        uint8_t payload[PAYLOAD_MAX];
        const uint32_t taxels = next_random() % (TAXELS + 1u);
        const uint16_t length = (uint16_t)(TAXEL_TAXEL_HEADER_SIZE + TAXEL_SNAPSHOT_OVERHEAD + 2u * taxels);
        for (unsigned k = 0; k < length; k++) {
            payload[k] = (uint8_t)(next_random() % 5u ? next_random() : 0);
        }
        payload[0] = TAXEL_ADDRESS_MIN;
        payload[1] = (uint8_t)taxels;
        struct taxel_encoder encoder;
        taxel_encoder_begin(&encoder, wire, sizeof wire, 0, TAXEL_FRAME_TYPE_TAXELS, (uint16_t)i, length);
        taxel_encoder_put(&encoder, payload, length);
        const size_t size = taxel_encoder_end(&encoder);
        checksum = taxel_crc32(checksum, wire, size);
        if (i % 4u == 3u) {
            wire[next_random() % size] ^= (uint8_t)(1u << next_random() % 8u);
        }
        taxel_deframer_push(&deframer, wire, size);
    }
    taxel_deframer_finish(&deframer);
    put_word("frames", checksum);
    put_word("found", (uint32_t)deframer.frames);
    put_word("discarded", (uint32_t)deframer.discarded_bytes);
}

/* HAL function of the board: there is no measuring circuit to configure. */
static void on_configure(void *context, const struct taxel_scan_settings *settings)
{
    (void)context;
    (void)settings;
}

/* HAL function of the board: count the conversion and add its TX and RX line to the checksum. */
static void on_start(void *context, uint8_t tx, uint8_t rx)
{
    (void)context;
    started++;
    checksum = checksum * 33u + tx * 16u + rx;
}

/* HAL function of the board: return a time that advances by 10 microseconds per started conversion. */
static uint32_t on_clock(void *context)
{
    (void)context;
    return started * 10u;
}

/* HAL function of the board: there are no interrupts to disable. */
static uint32_t on_disable(void *context)
{
    (void)context;
    return 0;
}

/* HAL function of the board: there are no interrupts to enable again. */
static void on_restore(void *context, uint32_t before)
{
    (void)context;
    (void)before;
}

/* HAL function of the board for a restart and for a start of the bootloader: print that one of them was requested. */
static void on_leave(void *context)
{
    (void)context;
    put_text("restart or bootloader requested\n");
}

static const struct taxel_sensor_hal hal = {
    .front_end_configure = on_configure,
    .conversion_start = on_start,
    .clock_us = on_clock,
    .interrupts_disable = on_disable,
    .interrupts_restore = on_restore,
    .restart = on_leave,
    .enter_bootloader = on_leave,
};

static const struct taxel_sensor_config board = {
    .hal = &hal,
    .address = 0x22,
    .kind = 1,
    .rows = ROWS,
    .columns = COLUMNS,
    .taxel_count = TAXELS,
    .crossing_map = crossing_map,
    .settings = {.sub_conversions = 160,
                 .sense_clock_divider = 40,
                 .modulator_clock_divider = 1,
                 .idac_code = 16,
                 .settle_cycles = 96},
    .snapshots = {snapshots[0], snapshots[1], snapshots[2]},
};

/* Read `size` registers of the board, starting at `pointer`, by the calls that the I2C interrupt handler makes, and add
 * the bytes to the checksum. */
static void read_registers(uint8_t pointer, unsigned size)
{
    taxel_sensor_on_address(&sensor, false);
    taxel_sensor_on_write(&sensor, pointer);
    taxel_sensor_on_stop(&sensor);
    taxel_sensor_on_address(&sensor, true);
    for (unsigned i = 0; i < size; i++) {
        const uint8_t byte = taxel_sensor_on_read(&sensor);
        checksum = taxel_crc32(checksum, &byte, 1);
    }
    taxel_sensor_on_stop(&sensor);
}

/* Scan 20 times with random raw counts and read registers every 100 conversions; print the numbers of scans and
 * conversions and a checksum of the registers. */
static void test_scans(void)
{
    put_word("accepted", (uint32_t)taxel_sensor_init(&sensor, &board));
    taxel_scan_start(&sensor);
    for (unsigned i = 0; i < 20u * TAXELS; i++) {
        taxel_sensor_on_conversion(&sensor, (uint16_t)next_random());
        if (i % 100u == 99u) {
            read_registers((uint8_t)(i / 100u * 16u), 40);
        }
    }
    put_word("scans", sensor.scan.scans);
    put_word("conversions", started);
    put_word("registers", checksum);
}

/* Run the codec and the board firmware without hardware; every emulator must print the same checksums. */
int main(void)
{
    memset(crossing_map, 0, sizeof crossing_map);
    for (unsigned i = 0; i < TAXELS; i++) {
        crossing_map[i / 8u] |= (uint8_t)(1u << i % 8u);
    }
    test_frames();
    test_scans();
    return 0;
}
