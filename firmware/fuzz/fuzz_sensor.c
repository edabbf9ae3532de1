/* Fuzz target: a sensor board's register machine and scan, driven by a script of bus events, conversions and time.
 *
 * The first bytes of the input configure the board (lines, crossing map, settings, initial counters); the other
 * bytes are events: single bus events in any order, also impossible ones, and complete transfers with a valid CRC,
 * so that deep states are reached. Invariants, after each event:
 *   - every byte read equals the model's (board_model.h): identity, status, settings, snapshots, FF elsewhere. So a
 *     snapshot is one complete scan with its sequence, time, counts and CRC; the identity never changes; the settings
 *     are the last accepted ones; counters saturate or wrap as specified, which boards with nearly full counters test;
 *   - every acknowledge equals the model's;
 *   - at most one conversion is in progress, at the expected crossing; the front end is configured between scans only;
 *   - the three snapshot buffers are distinct, and nothing is written outside them;
 *   - exactly the invalid configurations are rejected at boot. */
#include "fuzz/board_model.h"
#include "fuzz/fuzz.h"
#include "sensor/sensor.h"

#define EVENTS_MAX 160u
#define CONVERSIONS_MAX 1500u

static struct taxel_sensor sensor;
static struct taxel_sensor_config config;
static struct board_model model;
static uint8_t *snapshots[3];
static unsigned conversions_started, front_end_configurations, restarts, bootloader_entries, conversions_ended;
static bool converting;
static uint16_t crossing;                      /* TX * columns + RX of the last conversion that was started */
static uint8_t front_end[MODEL_SETTINGS_SIZE]; /* the settings that the front end received last */

/* HAL function of the simulated board: record the scan settings, which must not change during a conversion. */
static void on_configure(void *context, const struct taxel_scan_settings *settings)
{
    (void)context;
    FUZZ_CHECK(!converting);
    taxel_scan_settings_pack(settings, front_end);
    front_end_configurations++;
}

/* HAL function of the simulated board: record the start of a conversion, and check that its lines exist and that no
 * conversion is in progress. */
static void on_conversion_start(void *context, uint8_t tx, uint8_t rx)
{
    (void)context;
    FUZZ_CHECK(!converting && tx < config.rows && rx < config.columns);
    converting = true;
    crossing = (uint16_t)(tx * config.columns + rx);
    conversions_started++;
}

/* HAL function of the simulated board: return the simulated time in microseconds. */
static uint32_t on_clock_us(void *context)
{
    (void)context;
    return model.clock_us;
}

/* HAL function of the simulated board: return a value that on_interrupts_restore() must receive. */
static uint32_t on_interrupts_disable(void *context)
{
    (void)context;
    return 7;
}

/* HAL function of the simulated board: check that it receives the value of on_interrupts_disable(). */
static void on_interrupts_restore(void *context, uint32_t state)
{
    (void)context;
    FUZZ_CHECK(state == 7);
}

/* HAL function of the simulated board: count the requests for a restart. */
static void on_restart(void *context)
{
    (void)context;
    restarts++;
}

/* HAL function of the simulated board: count the requests for the bootloader. */
static void on_bootloader(void *context)
{
    (void)context;
    bootloader_entries++;
}

static const struct taxel_sensor_hal hal = {
    .front_end_configure = on_configure,
    .conversion_start = on_conversion_start,
    .clock_us = on_clock_us,
    .interrupts_disable = on_interrupts_disable,
    .interrupts_restore = on_interrupts_restore,
    .restart = on_restart,
    .enter_bootloader = on_bootloader,
};

/* Check that the state of the firmware equals the state of the model (counters, identity, settings, current crossing),
 * and that the three snapshot buffers are distinct. */
static void check_state(void)
{
    FUZZ_CHECK(converting == model.converting && conversions_started == model.conversions_started &&
               front_end_configurations == model.front_end_configurations);
    FUZZ_CHECK(memcmp(front_end, model.settings, sizeof front_end) == 0);
    FUZZ_CHECK(!converting || model.dropped_conversion || !model.scanning || crossing == model_crossing(&model));
    FUZZ_CHECK(sensor.slave.pointer == model.pointer && sensor.slave.written == model.written_size);
    FUZZ_CHECK(sensor.slave.bus_errors == model.bus_errors && sensor.slave.rejected_writes == model.rejected_writes);
    FUZZ_CHECK(sensor.slave.snapshot_reads == model.snapshot_reads && sensor.scan.scans == model.scans);
    FUZZ_CHECK(sensor.scan.saturated_conversions == model.saturated_conversions &&
               sensor.error_flags == model.error_flags);
    FUZZ_CHECK(memcmp(sensor.identity, model.identity, sizeof model.identity) == 0);
    FUZZ_CHECK(sensor.scan.scanning != sensor.scan.newest && sensor.scan.newest != sensor.scan.latched &&
               sensor.scan.latched != sensor.scan.scanning);
}

/* Initialise firmware and model, start scanning, and compare their states. Returns false if the firmware rejects the
 * configuration. */
static bool boot(void)
{
    converting = false;
    conversions_started = front_end_configurations = 0;
    if (taxel_sensor_init(&sensor, &config)) {
        return false;
    }
    model_boot(&model, config.firmware_version, config.kind, config.unique_id);
    taxel_scan_start(&sensor);
    model_start(&model);
    check_state();
    return true;
}

/* Send an address byte, for a read or a write, to firmware and model and check that both give the same acknowledge. */
static void address(bool reading)
{
    FUZZ_CHECK(taxel_sensor_on_address(&sensor, reading) == model_address(&model, reading));
}

/* Write one byte to firmware and model and check that both give the same acknowledge. */
static void write(uint8_t byte)
{
    FUZZ_CHECK(taxel_sensor_on_write(&sensor, byte) == model_write(&model, byte));
}

/* Read `size` bytes from firmware and model and check that they are equal. */
static void read(size_t size)
{
    for (size_t i = 0; i < size; i++) {
        FUZZ_CHECK(taxel_sensor_on_read(&sensor) == model_read(&model));
    }
}

/* Send a stop condition to firmware and model, and check that both request the same restart or bootloader. A requested
 * restart takes place at once. */
static void stop(void)
{
    taxel_sensor_on_stop(&sensor);
    model_stop(&model);
    FUZZ_CHECK((restarts != 0) == model.restart_requested && (bootloader_entries != 0) == model.bootloader_requested);
    if (restarts || bootloader_entries) { /* neither call returns on silicon: the board boots next */
        restarts = bootloader_entries = 0;
        FUZZ_CHECK(boot());
    }
}

/* End up to `count` conversions, with raw counts `first`, `first` + `step`, ... in turn; each lasts `step`
 * microseconds. Stops earlier when no conversion is in progress, or after CONVERSIONS_MAX conversions of one fuzz
 * input. */
static void convert(unsigned count, uint16_t first, uint8_t step)
{
    for (unsigned i = 0; i < count && conversions_ended < CONVERSIONS_MAX && converting; i++, conversions_ended++) {
        const uint16_t value = (uint16_t)(first + i * step);
        model.clock_us += step;
        converting = false;
        model_conversion(&model, value);
        taxel_sensor_on_conversion(&sensor, value);
    }
}

/* Write bytes to register `pointer` in a complete I2C transfer: address, pointer, bytes and stop condition. */
static void write_whole(uint8_t pointer, const uint8_t *bytes, size_t size)
{
    address(false);
    write(pointer);
    for (size_t i = 0; i < size; i++) {
        write(bytes[i]);
    }
    stop();
}

/* Write scan settings (register 0x60) from the fuzz input. `flags` 8 shortens the write by a byte, 15 computes the CRC
 * for another I2C address, and odd values make the settings small enough to be valid. */
static void write_settings(struct fuzz_input *input, uint8_t flags)
{
    uint8_t bytes[12];
    const uint8_t for_board = (uint8_t)(model.address ^ (flags == 0xF));
    (void)fuzz_bytes(input, bytes, 8);
    if (flags & 1u) {
        bytes[1] = bytes[3] = 0; /* both factors of the largest raw count are below 256 */
    }
    fuzz_put_u32(bytes + 8, fuzz_crc32(fuzz_crc32(0, &for_board, 1), bytes, 8));
    write_whole(0x60, bytes, sizeof bytes - (flags == 8));
}

/* Read in a complete I2C transfer from the register that `which` (0 to 15) selects: a snapshot or 64 bytes, and `extra`
 * bytes more. The first six are registers of the snapshot, which has 10 bytes besides its counts. */
static void read_whole(uint8_t which, size_t extra)
{
    static const uint8_t pointers[16] = {0x80, 0x80, 0x80, 0x81, 0x82, 0x8F, 0x00, 0x10,
                                         0x39, 0x40, 0x44, 0x5B, 0x60, 0x6B, 0x70, 0x90};
    const size_t size = which < 6 ? 10u + 2u * (size_t)config.taxel_count : 64u;
    address(false);
    write(pointers[which]);
    address(true);
    read(size + extra);
    stop();
}

/* Execute one event from the fuzz input on firmware and model, and compare their states. */
static void run_event(struct fuzz_input *input)
{
    const uint8_t op = fuzz_u8(input), high = op >> 4;
    switch (op & 15u) {
    case 0:
        address(false);
        break;
    case 1:
        address(true);
        break;
    case 2:
    case 3:
        write(fuzz_u8(input));
        break;
    case 4:
        read(high + 1u);
        break;
    case 5:
        read(16u * (high + 1u));
        break;
    case 6:
        stop();
        break;
    case 7:
        taxel_sensor_on_bus_error(&sensor);
        model_bus_error(&model);
        break;
    case 8:
        convert(high + 1u, fuzz_u16(input), high);
        break;
    case 9:
        convert(config.taxel_count * (1u + (high & 3u)) + (high >> 2), fuzz_u16(input), fuzz_u8(input));
        break;
    case 10:
        model.clock_us += (uint32_t)fuzz_u16(input) << high;
        break;
    case 11: { /* a command with its complement, also with the key of ENTER_BOOTLOADER, to the command register */
        static const uint8_t key[4] = {'B', 'O', 'O', 'T'};
        uint8_t bytes[6] = {high & 7u, (uint8_t)~(high & 7u)};
        memcpy(bytes + 2, key, sizeof key);
        write_whole(0x70, bytes, high & 8u ? 6 : 2);
        break;
    }
    case 12:
        write_settings(input, high);
        break;
    case 13:
        read_whole(high, 2);
        break;
    case 14: /* a poll: reads a snapshot without writing the register pointer first */
        address(true);
        read(10u + 2u * (size_t)config.taxel_count);
        stop();
        break;
    default:
        stop();
        break;
    }
    check_state();
}

/* Set all counters of firmware and model just below the value at which they saturate or wrap. */
static void fill_counters(void)
{
    sensor.scan.scans = model.scans = 0xFFFFFFFEu;
    sensor.slave.snapshot_reads = model.snapshot_reads = 0xFFFFFFFEu;
    sensor.slave.bus_errors = model.bus_errors = 0xFFFE;
    sensor.slave.rejected_writes = model.rejected_writes = 0xFFFE;
    sensor.scan.saturated_conversions = model.saturated_conversions = 0xFFFE;
    fuzz_put_u16(model.being_scanned.bytes, 0xFFFE); /* the scan in progress has its number already */
    fuzz_put_u16(sensor.scan.scanning, 0xFFFE);
    sensor.scan.crc = fuzz_crc32(fuzz_crc32(0, &model.address, 1), sensor.scan.scanning, 6);
}

/* Choose the crossing map of the model by the low two bits of `options`: all crossings (1), a pseudo-random half (2,
 * 3), or any 32 bytes of the input (0). Also sets the number of taxels of the model. */
static void choose_map(struct fuzz_input *input, uint8_t options)
{
    const unsigned crossings = (unsigned)model.rows * model.columns;
    uint64_t state = options;
    (void)fuzz_bytes(input, model.crossing_map, options & 3u ? 0u : 32u);
    for (unsigned i = 0; i < crossings && i < 256 && options & 3u; i++) {
        const bool taxel = (options & 3u) == 1u || fuzz_next(&state) & 1u;
        model.crossing_map[i / 8] |= (uint8_t)(taxel << (i % 8));
    }
    model.taxel_count = 0;
    for (unsigned i = 0; i < 256; i++) {
        model.taxel_count = (uint16_t)(model.taxel_count + (model.crossing_map[i / 8] >> (i % 8) & 1));
    }
}

/* Return whether taxel_sensor_init() must accept the configuration of the model with `claimed_taxels` taxels. */
static bool config_is_valid(uint16_t claimed_taxels)
{
    for (unsigned i = (unsigned)model.rows * model.columns; i < 256; i++) {
        if (model.crossing_map[i / 8] >> (i % 8) & 1) {
            return false;
        }
    }
    return model.rows >= 1 && model.rows <= 16 && model.columns >= 1 && model.columns <= 16 && model.taxel_count >= 1 &&
           model.taxel_count <= MODEL_TAXELS_MAX && claimed_taxels == model.taxel_count && model.address >= 0x08 &&
           model.address <= 0x77 && model_settings_are_valid(model.boot_settings);
}

/* Choose the configuration of model and firmware from the input, mostly a valid one. The bits of the first
 * byte, `options`, select its properties. Returns whether the counters shall start just below their limits. */
static bool choose_board(struct fuzz_input *input)
{
    /* 160 sub-conversions, clock dividers 40 and 1, IDAC code 16, 96 settle cycles (struct taxel_scan_settings) */
    static const uint8_t usual[MODEL_SETTINGS_SIZE] = {160, 0, 40, 0, 1, 16, 96, 0};
    const uint8_t options = fuzz_u8(input);
    memset(&model, 0, sizeof model);
    model.address = options & 4u ? fuzz_u8(input) : 0x20;
    model.rows = options & 8u ? fuzz_u8(input) % 20u : 3;
    model.columns = options & 8u ? fuzz_u8(input) % 20u : 4;
    model.reset_cause = options & 3u;
    model.clock_us = options & 0x10u ? 0xFFFFFF00u : 1000u;
    memcpy(model.boot_settings, usual, sizeof usual);
    if (options & 0x20u) {
        (void)fuzz_bytes(input, model.boot_settings, sizeof model.boot_settings);
    }
    choose_map(input, options);
    config = (struct taxel_sensor_config){
        .hal = &hal,
        .address = model.address,
        .kind = options,
        .reset_cause = model.reset_cause,
        .firmware_version = {1, 2, 3},
        .unique_id = {options, 2, 3, 4, 5, 6, 7, 8},
        .rows = model.rows,
        .columns = model.columns,
        .taxel_count =
            (uint16_t)(model.taxel_count + (options == 0x43)), /* one value of the options claims a taxel too many */
        .crossing_map = model.crossing_map,
        .snapshots = {snapshots[0], snapshots[1], snapshots[2]},
    };
    taxel_scan_settings_unpack(&config.settings, model.boot_settings);
    return options & 0x80u;
}

/* Run one fuzz input: the firmware of a sensor board and an independent model execute the same events. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct fuzz_input input = {bytes, size};
    conversions_started = front_end_configurations = restarts = bootloader_entries = conversions_ended = 0;
    const bool has_full_counters = choose_board(&input);
    const bool is_valid = config_is_valid(config.taxel_count);
    for (size_t i = 0; i < 3; i++) { /* of exactly the required size */
        snapshots[i] = malloc(TAXEL_SNAPSHOT_SIZE((size_t)config.taxel_count));
        config.snapshots[i] = snapshots[i];
    }
    if (boot()) {
        FUZZ_CHECK(is_valid);
        if (has_full_counters) {
            fill_counters();
        }
        for (unsigned i = 0; input.remaining && i < EVENTS_MAX; i++) {
            run_event(&input);
        }
    } else {
        FUZZ_CHECK(!is_valid);
    }
    for (size_t i = 0; i < 3; i++) {
        free(snapshots[i]);
    }
    return 0;
}
