/* Fuzz target: a board that encodes compact snapshots and a host that decodes them, over a faulty connection.
 *
 * The first bytes of the input configure the board; the other bytes are events: scans (quiet, noisy, with jumps,
 * with any counts), passes of the main loop, polls with and without the pointer, answers that arrive, are lost or
 * arrive late, restarts of either side, reads of uncompressed snapshots, damaged snapshots, and forged snapshots
 * with a valid CRC. Invariants:
 *   - a snapshot that the host decodes has the counts and the timestamp of the scan with its sequence;
 *   - a snapshot of the board has a valid CRC and is no longer than a packed frame;
 *   - if host and board have the same key frame id, their states are equal;
 *   - damaged snapshots are rejected; a forged snapshot causes no access out of bounds. */
#include "codec/compact_receiver.h"
#include "fuzz/fuzz.h"
#include "sensor/sensor.h"

#define EVENTS_MAX 160u
#define TAXELS_MAX 40u
#define HISTORY 4u
#define FRAME_MAX (TAXEL_COMPACT_BUFFER_SIZE(TAXELS_MAX) + 8u)

struct scan {
    bool exists;
    uint16_t sequence;
    uint32_t started_us;
    uint16_t counts[TAXELS_MAX];
};

static struct taxel_sensor sensor;
static struct taxel_sensor_config config;
static struct taxel_compact_receiver host;
static struct taxel_compact_snapshot decoded;
static struct scan history[HISTORY];
static uint16_t counts[TAXELS_MAX];
static uint8_t crossing_map[TAXEL_CROSSING_MAP_SIZE];
static uint32_t now_us;
static uint8_t late_answer[3], late_size;

/* HAL function of the simulated board: ignore scan settings. */
static void on_configure(void *context, const struct taxel_scan_settings *settings)
{
    (void)context;
    (void)settings;
}

/* HAL function of the simulated board: start a conversion. Does nothing, because run_scan() reports the result. */
static void on_start(void *context, uint8_t tx, uint8_t rx)
{
    (void)context;
    (void)tx;
    (void)rx;
}

/* HAL function of the simulated board: return the simulated time in microseconds. */
static uint32_t on_clock(void *context)
{
    (void)context;
    return now_us;
}

/* HAL function of the simulated board: mask interrupts, which do not exist here. */
static uint32_t on_disable(void *context)
{
    (void)context;
    return 1;
}

/* HAL function of the simulated board: restore the interrupt mask, which does not exist here. */
static void on_restore(void *context, uint32_t state)
{
    (void)context;
    (void)state;
}

/* HAL function of the simulated board: ignore the request for a restart or for the bootloader. */
static void on_restart(void *context)
{
    (void)context;
}

static const struct taxel_sensor_hal hal = {
    .front_end_configure = on_configure,
    .conversion_start = on_start,
    .clock_us = on_clock,
    .interrupts_disable = on_disable,
    .interrupts_restore = on_restore,
    .restart = on_restart,
    .enter_bootloader = on_restart,
};

/* Restart the sensor firmware, clear the history of its scans, and start continuous scans. */
static void boot(void)
{
    FUZZ_CHECK(taxel_sensor_init(&sensor, &config) == 0);
    memset(history, 0, sizeof history);
    taxel_scan_start(&sensor);
}

/* Run one complete scan of the board and store its counts in the history. The low two bits of `pattern` select
 * unchanged counts (0), small changes of -3 to 3 (1), jumps of a few taxels as in a contact (2), or any counts (3); the
 * higher bits are the time per taxel in microseconds, less one. */
static void run_scan(uint8_t pattern, uint64_t *state)
{
    struct scan *slot = &history[sensor.scan.scans % HISTORY];
    slot->exists = true;
    slot->sequence = (uint16_t)sensor.scan.scans;
    slot->started_us = sensor.scan.started_us;
    for (uint16_t i = 0; i < config.taxel_count; i++) {
        const uint8_t random_byte = fuzz_next(state);
        const uint16_t any = (uint16_t)(random_byte | fuzz_next(state) << 8);
        const bool jumps = (pattern & 3u) == 3u || ((pattern & 3u) == 2u && random_byte < 16u);
        counts[i] =
            jumps ? any : (uint16_t)(counts[i] + (pattern & 3u ? (random_byte % 7u) : 0u) - (pattern & 3u ? 3u : 0u));
        slot->counts[i] = counts[i];
        now_us += 1u + (pattern >> 2);
        taxel_sensor_on_conversion(&sensor, counts[i]);
    }
}

/* Write bytes to register `pointer` of the board over I2C, with or without a stop condition at the end. */
static void write_bytes(uint8_t pointer, const uint8_t *bytes, size_t size, bool stop)
{
    FUZZ_CHECK(taxel_sensor_on_address(&sensor, false));
    FUZZ_CHECK(taxel_sensor_on_write(&sensor, pointer));
    for (size_t i = 0; i < size; i++) {
        (void)taxel_sensor_on_write(&sensor, bytes[i]);
    }
    if (stop) {
        taxel_sensor_on_stop(&sensor);
    }
}

/* Take the host's answer to a key frame (acknowledge, or forget the key frame). The low two bits of `delivery` select:
 * write it to the board now (0), lose it (1), keep it for later (2), or lose it and write the kept one (3). */
static void send_answer(uint8_t delivery)
{
    uint8_t bytes[3] = {0};
    uint8_t size = 0;
    if (host.answer == TAXEL_COMPACT_ANSWER_ACKNOWLEDGE) {
        taxel_put_u16(bytes, host.pending.id);
        size = 2;
    } else if (host.answer == TAXEL_COMPACT_ANSWER_FORGET) {
        size = 1;
    }
    host.answer = TAXEL_COMPACT_ANSWER_NONE;
    if ((delivery & 3u) == 3u && late_size) { /* the earlier answer arrives now */
        write_bytes(TAXEL_REGISTER_COMPACT, late_answer, late_size, true);
        late_size = 0;
    } else if ((delivery & 3u) == 2u && size) {
        memcpy(late_answer, bytes, size);
        late_size = size;
    } else if ((delivery & 3u) == 0 && size) {
        write_bytes(TAXEL_REGISTER_COMPACT, bytes, size, true);
    }
}

/* Check that board and host have equal taxel states if both use the same key frame. */
static void check_states(void)
{
    const struct taxel_compact *compact = &sensor.compact;
    const struct taxel_compact_key_frame *key_frame = &host.key_frame;
    if (!compact->has_key_frame || !key_frame->is_valid || key_frame->id != compact->key_frame_id) {
        return;
    }
    FUZZ_CHECK(key_frame->updates == compact->updates && key_frame->timestamp_us == compact->key_frame_us);
    FUZZ_CHECK(memcmp(key_frame->states, config.compact.states, config.taxel_count * sizeof key_frame->states[0]) == 0);
}

/* Decode a compact snapshot as the host. `damage` other than 0 changes one byte: the host must reject the snapshot and
 * keep its state. An undamaged snapshot must give counts and timestamp of the scan with its sequence number. */
static void receive(const uint8_t *bytes, size_t size, uint8_t damage)
{
    uint8_t *copy = malloc(size); /* exact size, so that a sanitizer detects an access behind it */
    memcpy(copy, bytes, size);
    FUZZ_CHECK(size >= TAXEL_COMPACT_OVERHEAD_DELTA);
    /* At most a packed frame (2 bytes per taxel), padded to whole words; not checked for a board of one taxel. */
    FUZZ_CHECK(size <= ((TAXEL_COMPACT_OVERHEAD_PACKED + 2u * config.taxel_count + 3u) & ~3u) ||
               config.taxel_count < 2u);
    if (damage) {
        copy[damage % size] ^= damage;
        const struct taxel_compact_receiver before = host;
        FUZZ_CHECK(taxel_compact_receive(&host, config.address, (uint8_t)config.taxel_count, copy, size, &decoded) ==
                   TAXEL_COMPACT_DAMAGED);
        FUZZ_CHECK(memcmp(&before, &host, sizeof host) == 0);
    } else {
        const enum taxel_compact_result result =
            taxel_compact_receive(&host, config.address, (uint8_t)config.taxel_count, copy, size, &decoded);
        FUZZ_CHECK(result != TAXEL_COMPACT_DAMAGED);
        const struct scan *original = &history[decoded.sequence % HISTORY];
        if (result == TAXEL_COMPACT_OK && original->exists && original->sequence == decoded.sequence) {
            FUZZ_CHECK(memcmp(decoded.counts, original->counts, config.taxel_count * sizeof counts[0]) == 0);
            FUZZ_CHECK(decoded.timestamp_us == original->started_us);
        }
    }
    free(copy);
}

/* Read register COMPACT of the board as the hub does, with a pass of the main loop in the middle of the read, and
 * deliver the snapshot to the host. `with_pointer`: write the register pointer first, after which the board may repeat
 * a snapshot. `damage`: damage of the delivered snapshot, see receive(). */
static void poll_board(bool with_pointer, uint8_t damage)
{
    uint8_t bytes[FRAME_MAX];
    if (with_pointer) {
        write_bytes(TAXEL_REGISTER_COMPACT, NULL, 0, false);
    } else if (sensor.slave.pointer != TAXEL_REGISTER_COMPACT) {
        write_bytes(TAXEL_REGISTER_COMPACT, NULL, 0, true);
    }
    FUZZ_CHECK(taxel_sensor_on_address(&sensor, true));
    const size_t size = taxel_compact_size(taxel_sensor_on_read(&sensor));
    FUZZ_CHECK(size <= sizeof bytes);
    for (size_t i = 0; i < size; i++) {
        bytes[i] = taxel_sensor_on_read(&sensor);
        if (i == size / 2u) {
            taxel_sensor_run(&sensor); /* the main loop runs during a read */
        }
    }
    FUZZ_CHECK(taxel_sensor_on_read(&sensor) == 0xFF); /* the board sends 0xFF behind the snapshot */
    taxel_sensor_on_stop(&sensor);
    if (size) {
        receive(bytes, size, damage);
    }
}

/* Send a forged snapshot (pseudo-random bytes with a valid CRC) to the host twice, the second time to a host whose
 * state the first one may have changed. The only expectation is that no access is out of bounds. The state of the host
 * is restored afterwards. */
static void forge(struct fuzz_input *input)
{
    const struct taxel_compact_receiver before = host;
    const uint8_t address = fuzz_u8(input), taxels = fuzz_u8(input), format = fuzz_u8(input);
    const size_t size = TAXEL_COMPACT_OVERHEAD_DELTA + fuzz_u8(input) % 64u;
    uint64_t state = format;
    uint8_t *bytes = malloc(size);
    for (size_t i = 0; i < size; i++) {
        bytes[i] = fuzz_next(&state);
    }
    bytes[TAXEL_COMPACT_HEADER_OFFSET_FORMAT] = format;
    taxel_put_u16(bytes + TAXEL_COMPACT_DELTA_OFFSET_KEY_FRAME, format & 0x40u ? host.pending.id : host.key_frame.id);
    fuzz_put_u32(bytes + size - 4u, fuzz_crc32(fuzz_crc32(0, &address, 1), bytes, size - 4u));
    (void)taxel_compact_receive(&host, address, taxels, bytes, size, &decoded);
    (void)taxel_compact_receive(&host, address, taxels, bytes, size, &decoded);
    free(bytes);
    host = before;
}

/* Read 8 * `count` bytes of the uncompressed snapshot, from register SNAPSHOT plus the low two bits of `count` on. A
 * read of register SNAPSHOT itself latches a newer scan, which the encoder of compact snapshots must tolerate. */
static void read_uncompressed(uint8_t count)
{
    write_bytes((uint8_t)(TAXEL_REGISTER_SNAPSHOT + (count & 3u)), NULL, 0, false);
    if (taxel_sensor_on_address(&sensor, true)) {
        for (unsigned i = 0; i < 8u * count; i++) {
            (void)taxel_sensor_on_read(&sensor);
        }
    }
    taxel_sensor_on_stop(&sensor);
}

/* Execute one event from the fuzz input (scan, pass of the main loop, poll, answer, restart, uncompressed read, forged
 * snapshot or elapsed time), then compare the states of board and host. */
static void run_event(struct fuzz_input *input, uint64_t *state)
{
    const uint8_t op = fuzz_u8(input), high = op >> 4;
    switch (op & 15u) {
    case 0:
    case 1:
    case 2:
    case 3:
        run_scan(high, state);
        break;
    case 4:
    case 5:
        taxel_sensor_run(&sensor);
        break;
    case 6: /* scan, poll and acknowledge without a fault */
        run_scan(high & 1u, state);
        taxel_sensor_run(&sensor);
        send_answer(0);
        poll_board(false, 0);
        break;
    case 7:
    case 8:
        poll_board(high & 1u, 0);
        break;
    case 9:
        poll_board(high & 1u, fuzz_u8(input));
        break;
    case 10:
    case 11:
        send_answer(high);
        break;
    case 12:
        memset(&host, 0, sizeof host); /* another host */
        break;
    case 13:
        if (high == 15u) {
            boot();
        } else {
            read_uncompressed(high);
        }
        break;
    case 14:
        forge(input);
        break;
    default:
        now_us += (uint32_t)fuzz_u16(input) << high;
        break;
    }
    check_states();
}

/* Run one fuzz input: a board with 1 to TAXELS_MAX taxels and a host exchange compact snapshots with lost, late and
 * damaged messages. All buffers have exactly the required size. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct fuzz_input input = {bytes, size};
    uint64_t state = fuzz_u16(&input);
    const uint8_t taxels = (uint8_t)(1u + fuzz_u8(&input) % TAXELS_MAX);
    memset(crossing_map, 0, sizeof crossing_map);
    for (unsigned i = 0; i < taxels; i++) {
        crossing_map[i / 8u] |= (uint8_t)(1u << i % 8u);
        counts[i] = (uint16_t)(2000u + i);
    }
    config = (struct taxel_sensor_config){
        .hal = &hal,
        .address = 0x20,
        .rows = 5,
        .columns = 8,
        .taxel_count = taxels,
        .crossing_map = crossing_map,
        .settings = {.sub_conversions = 160, .sense_clock_divider = 40, .modulator_clock_divider = 1, .idac_code = 96},
        .compact = {.states = malloc(taxels * sizeof(taxel_compact_state)), .residuals = malloc(taxels)},
    };
    for (size_t i = 0; i < 3u; i++) {
        config.snapshots[i] = malloc(TAXEL_SNAPSHOT_SIZE((size_t)taxels));
    }
    for (size_t i = 0; i < 2u; i++) {
        config.compact.buffers[i] = malloc(TAXEL_COMPACT_BUFFER_SIZE((size_t)taxels));
    }
    memset(&host, 0, sizeof host);
    late_size = 0;
    now_us = (uint32_t)state << 16;
    boot();
    for (unsigned i = 0; input.remaining && i < EVENTS_MAX; i++) {
        run_event(&input, &state);
    }
    for (size_t i = 0; i < 3u; i++) {
        free(config.snapshots[i]);
    }
    free(config.compact.buffers[0]);
    free(config.compact.buffers[1]);
    free(config.compact.states);
    free(config.compact.residuals);
    return 0;
}
