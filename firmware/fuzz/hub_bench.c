#include "fuzz/hub_bench.h"

#include "codec/encoder.h"

#define RUN_COST_US 5u
#define SPIN_CALLS 512u /* clock readings in one pass of the main loop; a correct pass needs fewer than a hundred */

struct bench bench;

/* The hub's memory on one of the buses, in blocks of exactly the configured sizes, so that a sanitizer detects an
 * access beyond a block. */
struct blocks {
    struct taxel_hub_slot *slots;
    uint8_t *pool;
    uint8_t *ring;
};

/* A saved state of the bench and its memory blocks. */
struct saved {
    bool exists;
    struct bench bench;
    struct blocks copies;
};

static struct blocks blocks[BENCH_BUSES];
static struct saved saved[BENCH_BUSES][BENCH_STATES];

/* HAL function of the hub: return the simulated time, and check that one pass of the main loop does not read it
 * forever. */
static uint64_t on_clock_us(void *context)
{
    (void)context;
    FUZZ_CHECK(++bench.clock_calls <= SPIN_CALLS); /* otherwise the main loop does not return */
    return bench.now_us;
}

/* End the hub's I2C transfer with the selected outcome: a failure, or a transfer on the simulated bus, whose bytes read
 * may be damaged. Checks that the bytes to write are unchanged since the start. The next transfer will have no
 * fault. */
static void end_transfer(void)
{
    const struct taxel_i2c_transfer *transfer = &bench.transfer;
    int8_t result = TAXEL_I2C_OK;
    const int outcome = bench.outcome;
    bench.outcome = BENCH_PROCEED;
    bench.done_us = BENCH_NEVER;
    FUZZ_CHECK(memcmp(transfer->write_bytes, bench.transfer_write, transfer->write_size) == 0);
    if (outcome <= 0) { /* a result of enum taxel_i2c_result, without a transfer on the bus */
        result = (int8_t)outcome;
    } else {
        result = bench_transfer(transfer);
    }
    if (transfer->read_size && (outcome == BENCH_FLIP || outcome == BENCH_NOISE)) {
        transfer->read_bytes[bench.damage_position % transfer->read_size] ^= bench.damage_value;
        for (size_t i = 0; outcome == BENCH_NOISE && i < transfer->read_size; i++) {
            transfer->read_bytes[i] = (uint8_t)(bench.damage_value + i * bench.damage_position);
        }
    }
    taxel_hub_on_i2c_done(&bench.hub, result);
}

/* HAL function of the hub: start a transfer. Checks address, sizes and buffer, and schedules the end after the time on
 * the bus. A held line makes the transfer end as busy; the outcome BENCH_HANG makes it never end. */
static void on_i2c_start(void *context, const struct taxel_i2c_transfer *transfer)
{
    (void)context;
    const struct taxel_hub *const hub = &bench.hub;
    FUZZ_CHECK(bench.done_us == BENCH_NEVER && bench.scl && bench.sda);
    FUZZ_CHECK(transfer->address >= TAXEL_ADDRESS_MIN);
    FUZZ_CHECK(transfer->address <= TAXEL_ADDRESS_MAX);
    FUZZ_CHECK(transfer->write_size <= BENCH_WRITE_MAX);
    FUZZ_CHECK(transfer->read_size <= taxel_hub_read_max(hub) + transfer->length_prefixed);
    const size_t offset = (size_t)(transfer->read_bytes + transfer->length_prefixed - bench.config.transfer_pool);
    bench_check_buffer(offset, transfer->read_size - transfer->length_prefixed);
    bench.transfer = *transfer;
    memcpy(bench.transfer_write, transfer->write_bytes, transfer->write_size);
    memset(transfer->read_bytes, 0xEE, transfer->read_size); /* the bus may overwrite it at once */
    bench.done_us =
        bench.now_us + 5u + (2u + transfer->write_size + transfer->read_size) * 9u * 1000000u / bench.config.scl_hz;
    if (bench.scl_held || bench.sda_held_clocks) {
        bench.outcome = TAXEL_I2C_BUSY;
    }
    if (bench.outcome == BENCH_HANG) {
        bench.outcome = BENCH_PROCEED;
        bench.done_us = BENCH_NEVER - 1u; /* in progress, but never due */
    } else if (bench.ends_at_once) {
        end_transfer();
    }
}

/* HAL function of the hub: abort the transfer in progress; there must be one. */
static void on_i2c_abort(void *context)
{
    (void)context;
    FUZZ_CHECK(bench.done_us != BENCH_NEVER);
    bench.done_us = BENCH_NEVER;
}

/* HAL function of the hub: drive SCL and SDA during bus recovery, when no transfer may be in progress. Each falling
 * edge of SCL brings a slave that holds SDA low one clock closer to its release. */
static void on_i2c_drive(void *context, bool scl_high, bool sda_high)
{
    (void)context;
    FUZZ_CHECK(bench.done_us == BENCH_NEVER);
    if (bench.scl && !scl_high && bench.sda_held_clocks) {
        bench.sda_held_clocks--;
    }
    bench.scl = scl_high;
    bench.sda = sda_high;
}

/* HAL function of the hub: return the level of SCL, which a board may hold low. */
static bool on_i2c_scl(void *context)
{
    (void)context;
    return bench.scl && !bench.scl_held;
}

/* HAL function of the hub: return the level of SDA, which a board may hold low. */
static bool on_i2c_sda(void *context)
{
    (void)context;
    return bench.sda && !bench.sda_held_clocks;
}

/* HAL function of the hub: start the UART. Does nothing, because bench_pull() takes the bytes. */
static void on_uart_kick(void *context)
{
    (void)context;
}

/* HAL function of the hub: flow control, which requests the host to pause (`hold`) or to continue. */
static void on_uart_hold(void *context, bool hold)
{
    (void)context;
    bench.host_is_held = hold;
}

/* HAL function of the hub: advance the simulated time. */
static void on_delay_us(void *context, uint32_t microseconds)
{
    (void)context;
    bench.now_us += microseconds;
}

/* HAL function of the hub: request a pass of the main loop at a time; the earliest request of a pass counts. */
static void on_wake_at(void *context, uint64_t clock_us)
{
    (void)context;
    bench.wake_us = clock_us < bench.wake_us ? clock_us : bench.wake_us;
}

/* HAL function of the hub: record a request for a restart or for the bootloader. */
static void on_restart(void *context)
{
    (void)context;
    bench.restarted = true;
}

static const struct taxel_hub_hal hal = {
    .i2c_start = on_i2c_start,
    .i2c_abort = on_i2c_abort,
    .i2c_drive = on_i2c_drive,
    .i2c_scl = on_i2c_scl,
    .i2c_sda = on_i2c_sda,
    .uart_kick = on_uart_kick,
    .uart_hold = on_uart_hold,
    .clock_us = on_clock_us,
    .delay_us = on_delay_us,
    .wake_at = on_wake_at,
    .restart = on_restart,
    .enter_bootloader = on_restart,
};

/* Take up to `size` bytes from the hub as the UART does and decode them as the host. Each byte must belong to a valid
 * frame. */
void bench_pull(size_t size)
{
    uint8_t bytes[64];
    while (size) {
        const size_t pulled = taxel_hub_uart_pull(&bench.hub, bytes, size < sizeof bytes ? size : sizeof bytes);
        taxel_deframer_push(&bench.deframer, bytes, pulled);
        bench.bytes_pulled += pulled;
        size = pulled ? size - pulled : 0;
    }
    FUZZ_CHECK(bench.deframer.discarded_bytes == 0);
}

/* Run one pass of the hub's main loop, which costs RUN_COST_US, and check the hub. If the host reads, it then takes all
 * bytes from the UART. */
void bench_pass(void)
{
    bench.wake_us = BENCH_NEVER;
    bench.clock_calls = 0;
    taxel_hub_run(&bench.hub);
    bench.now_us += RUN_COST_US;
    if (bench.host_reads) {
        bench_pull(SIZE_MAX);
    }
    bench_check_hub();
    /* Without a wake-up request, a transfer in progress or an ended transfer, the main loop would never run again. */
    FUZZ_CHECK(bench.restarted || bench.wake_us != BENCH_NEVER || bench.done_us < BENCH_NEVER - 1u ||
               bench.hub.job_done);
}

/* Advance the simulated time to the next event (end of a transfer or requested wake-up), at most to `until_us`, and run
 * the hub. Returns false, without a change, if no event is due until then. */
bool bench_step(uint64_t until_us)
{
    const uint64_t next = bench.hub.job_done              ? bench.now_us
                          : bench.wake_us < bench.done_us ? bench.wake_us
                                                          : bench.done_us;
    if (next > until_us) {
        return false;
    }
    bench.now_us = next > bench.now_us ? next : bench.now_us;
    if (bench.done_us <= bench.now_us) {
        end_transfer();
    }
    bench_pass();
    return true;
}

/* Deliver bytes of the host to the hub's UART interrupt, then run the main loop once. */
void bench_receive(const uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        taxel_hub_on_uart_byte(&bench.hub, bytes[i]);
    }
    bench_pass();
}

/* Encode a frame of the host with sequence number 0 into `wire`, including delimiters. Returns its length in bytes. */
size_t bench_frame(uint8_t type, const uint8_t *payload, size_t size, uint8_t *wire, size_t capacity)
{
    struct taxel_encoder encoder;
    FUZZ_CHECK(capacity >= taxel_encoded_size_max(size));
    taxel_encoder_begin(&encoder, wire, capacity, 0, type, 0, (uint16_t)size);
    taxel_encoder_put(&encoder, payload, size);
    return taxel_encoder_end(&encoder);
}

/* Reset bench and hub with the boards of bus number `bus`, and run the hub's main loop once. */
static void boot(unsigned bus)
{
    memset(&bench, 0, sizeof bench);
    bench_populate(bus);
    const struct taxel_deframer_config host = {
        .chunk = bench.chunk,
        .chunk_capacity = sizeof bench.chunk,
        .body = bench.body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = TAXEL_DIRECTION_TO_HOST,
        .handler = bench_check_frame,
    };
    taxel_deframer_init(&bench.deframer, &host);
    bench.config.hal = &hal;
    bench.config.scl_hz = 400000;
    bench.config.firmware_version = bench.config.unique_id = (const uint8_t *)"12345678";
    bench.config.slots = blocks[bus].slots;
    bench.config.transfer_pool = blocks[bus].pool;
    bench.config.transmit_ring = blocks[bus].ring;
    bench.scl = bench.sda = bench.host_reads = true;
    bench.now_us = 1000;
    bench.done_us = BENCH_NEVER;
    bench.outcome = BENCH_PROCEED;
    taxel_hub_init(&bench.hub, &bench.config, TAXEL_RESET_CAUSE_POWER_ON);
    bench_pass();
}

/* Run the hub until the given simulated time has elapsed or no event is due. */
static void run_for(uint64_t microseconds)
{
    const uint64_t until = bench.now_us + microseconds;
    while (bench.now_us <= until && bench_step(until)) {
    }
}

/* Bring a started hub into `state`: boards found and handshake completed (BENCH_WARM), or also streaming for three poll
 * cycles (BENCH_STREAMING). */
static void warm_up(enum bench_state state)
{
    /* 77, 78: arbitrary tags of the two requests */
    static const uint8_t handshake[3] = {77, 1, TAXEL_PROTOCOL_VERSION}, start[2] = {78, TAXEL_COMMAND_START};
    uint8_t wire[64];
    if (state >= BENCH_WARM) {
        run_for(60000);
        bench_receive(wire,
                      bench_frame(TAXEL_FRAME_TYPE_HOST_HANDSHAKE, handshake, sizeof handshake, wire, sizeof wire));
    }
    if (state >= BENCH_STREAMING) {
        bench_receive(wire, bench_frame(TAXEL_FRAME_TYPE_COMMAND, start, sizeof start, wire, sizeof wire));
        run_for(30000);
    }
}

/* Copy the content of the hub's memory blocks, whose sizes are those of the current configuration. */
static void copy_blocks(const struct blocks *to, const struct blocks *from)
{
    memcpy(to->slots, from->slots, bench.config.slot_capacity * sizeof *to->slots);
    memcpy(to->pool, from->pool, bench.config.transfer_pool_size);
    memcpy(to->ring, from->ring, bench.config.transmit_ring_size);
}

/* Allocate zeroed memory blocks of the sizes in the current configuration. */
static struct blocks new_blocks(void)
{
    return (struct blocks){
        .slots = calloc(bench.config.slot_capacity, sizeof(struct taxel_hub_slot)),
        .pool = calloc(1, bench.config.transfer_pool_size),
        .ring = calloc(1, bench.config.transmit_ring_size),
    };
}

/* Restore bench and hub on bus number `bus` in the given state. The first call for a bus and a state boots the hub and
 * saves the result; later calls copy the saved state, which makes each fuzz input faster. */
void bench_restore(unsigned bus, enum bench_state state)
{
    struct saved *const snapshot = &saved[bus][state];
    if (!snapshot->exists) {
        bench_populate(bus);
        if (!blocks[bus].ring) {
            blocks[bus] = new_blocks();
        }
        boot(bus);
        warm_up(state);
        snapshot->copies = new_blocks();
        snapshot->bench = bench;
        snapshot->exists = true;
        copy_blocks(&snapshot->copies, &blocks[bus]);
    }
    bench = snapshot->bench;
    copy_blocks(&blocks[bus], &snapshot->copies);
}
