#include "fuzz/hub_bench.h"

#include "codec/encoder.h"

#define RUN_COST_US 5u
#define SPIN_CALLS 512u /* clock readings in one pass of the main loop; a correct pass needs fewer than a hundred */
#define ENDED_COUNTERS(s) \
    ((s)->forwarded + (s)->repeated + (s)->nacks + (s)->timeouts + (s)->crc_errors + (s)->bus_errors + (s)->dropped)

struct bench bench;

/* Memory of a bus, of exactly the configured sizes, so that a sanitizer detects an access behind it. */
struct blocks {
    struct taxel_hub_slot *slots;
    uint8_t *pool;
    uint8_t *ring;
};

struct saved {
    bool exists;
    struct bench bench;
    struct blocks copies;
};

static struct blocks blocks[BENCH_BUSES];
static struct saved saved[BENCH_BUSES][BENCH_STATES];

static uint64_t on_clock_us(void *context)
{
    (void)context;
    FUZZ_CHECK(++bench.clock_calls <= SPIN_CALLS); /* otherwise the main loop does not return */
    return bench.now_us;
}

/* End the hub's I2C transfer with the selected outcome, damage included. The bytes to write must be unchanged since its
 * start. */
static void end_transfer(void)
{
    const struct taxel_i2c_transfer *transfer = &bench.transfer;
    int8_t result = TAXEL_I2C_OK;
    const int outcome = bench.outcome;
    bench.outcome = BENCH_PROCEED;
    bench.done_us = BENCH_NEVER;
    FUZZ_CHECK(memcmp(transfer->write_bytes, bench.transfer_write, transfer->write_size) == 0);
    if (outcome <= 0) {
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

static void check_disjoint(size_t begin, size_t end, size_t other_begin, size_t other_end)
{
    FUZZ_CHECK(end <= other_begin || other_end <= begin);
}

/* The bytes read begin at `offset` of the pool: they, their headroom and their tailroom overlap no other buffer. */
static void check_buffer(size_t offset, size_t size)
{
    const struct taxel_hub *const hub = &bench.hub;
    const size_t begin = hub->job.pool_offset, end = offset + size + TAXEL_HUB_TAILROOM;
    FUZZ_CHECK(offset == begin + TAXEL_HUB_HEADROOM ||
               (offset == begin + TAXEL_HUB_HEADROOM + TAXEL_IDENTITY_SIZE && size == 12));
    FUZZ_CHECK(end <= bench.config.transfer_pool_size);
    if (hub->unframed.size) {
        check_disjoint(begin, end, hub->unframed.pool_offset,
                       hub->unframed.pool_offset + TAXEL_HUB_BUFFER_SIZE(hub->unframed.size));
    }
    for (size_t i = 0; i < TAXEL_HUB_LARGE_MAX; i++) {
        const struct taxel_large *const large = &hub->outbox.large[i];
        if (large->remaining) {
            check_disjoint(begin, end, large->end - large->remaining, large->end);
        }
    }
}

/* Processor interface: start of a transfer. Checks address, sizes and buffer, and schedules the end after the time on
 * the bus. */
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
    check_buffer(offset, transfer->read_size - transfer->length_prefixed);
    bench.transfer = *transfer;
    memcpy(bench.transfer_write, transfer->write_bytes, transfer->write_size);
    memset(transfer->read_bytes, 0xEE, transfer->read_size); /* the bus may begin to fill it at once */
    bench.done_us =
        bench.now_us + 5u + (2u + transfer->write_size + transfer->read_size) * 9u * 1000000u / bench.config.scl_hz;
    if (bench.scl_held || bench.sda_held_clocks) {
        bench.outcome = TAXEL_I2C_BUSY;
    }
    if (bench.outcome == BENCH_HANG) {
        bench.outcome = BENCH_PROCEED;
        bench.done_us = BENCH_NEVER - 1u;
    } else if (bench.ends_at_once) {
        end_transfer();
    }
}

static void on_i2c_abort(void *context)
{
    (void)context;
    FUZZ_CHECK(bench.done_us != BENCH_NEVER);
    bench.done_us = BENCH_NEVER;
}

/* Processor interface: the hub drives SCL and SDA during bus recovery. Each falling edge of SCL advances a slave that
 * holds SDA. */
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

static bool on_i2c_scl(void *context)
{
    (void)context;
    return bench.scl && !bench.scl_held;
}

static bool on_i2c_sda(void *context)
{
    (void)context;
    return bench.sda && !bench.sda_held_clocks;
}

static void on_uart_kick(void *context)
{
    (void)context;
}

static void on_uart_hold(void *context, bool hold)
{
    (void)context;
    bench.host_is_held = hold;
}

static void on_delay_us(void *context, uint32_t microseconds)
{
    (void)context;
    bench.now_us += microseconds;
}

static void on_wake_at(void *context, uint64_t clock_us)
{
    (void)context;
    bench.wake_us = clock_us < bench.wake_us ? clock_us : bench.wake_us;
}

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

/* Check one frame that the host receives. */
static void on_frame(void *context, const struct taxel_frame *frame)
{
    const uint8_t *payload = frame->payload;
    (void)context;
    FUZZ_CHECK(frame->type != TAXEL_FRAME_TYPE_COMPACT_TAXELS || bench.compact_requested);
    FUZZ_CHECK(frame->sequence == (uint16_t)bench.frames_pulled);
    bench.frames_pulled++;
    if (frame->type == TAXEL_FRAME_TYPE_TAXELS || frame->type == TAXEL_FRAME_TYPE_COMPACT_TAXELS) {
        const size_t size = frame->length - TAXEL_TAXEL_HEADER_SIZE;
        const uint32_t crc = fuzz_crc32(fuzz_crc32(0, payload, 1), payload + TAXEL_TAXEL_HEADER_SIZE, size - 4u);
        FUZZ_CHECK(crc == taxel_get_u32(payload + frame->length - 4));
    } else if (frame->type == TAXEL_FRAME_TYPE_BOARD_INFO) {
        FUZZ_CHECK(fuzz_crc32(0, payload, 54) == taxel_get_u32(payload + 54));
    } else if (frame->type == TAXEL_FRAME_TYPE_HUB_STATUS) {
        struct taxel_hub_status status;
        taxel_hub_status_unpack(&status, payload);
        FUZZ_CHECK((uint16_t)status.frames_sent == frame->sequence &&
                   status.boards_streaming <= bench.config.slot_capacity);
    } else if (frame->type == TAXEL_FRAME_TYPE_BOARD_STATUS) {
        struct taxel_board_status status;
        taxel_board_status_unpack(&status, payload);
        const uint32_t open_polls = status.polls - ENDED_COUNTERS(&status);
        FUZZ_CHECK(open_polls <= 1u);
        FUZZ_CHECK(status.state <= TAXEL_BOARD_STATE_INCOMPATIBLE);
    } else if (frame->type == TAXEL_FRAME_TYPE_REPLY) {
        bench.replies++;
        bench.replies_bad += payload[2] != TAXEL_REPLY_STATUS_OK;
        bench.replies_busy += payload[2] == TAXEL_REPLY_STATUS_BUSY;
    }
}

/* Take up to `size` bytes from the hub as the UART does and decode them as the host. No byte may belong to no frame. */
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

/* Check the hub's slots: sorted valid addresses, and every ended poll in exactly one outcome counter. */
static void check_slots(void)
{
    const struct taxel_hub *hub = &bench.hub;
    FUZZ_CHECK(hub->slot_count <= bench.config.slot_capacity);
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        const struct taxel_hub_slot *slot = &bench.config.slots[i];
        const bool is_polled =
            hub->job.slot == i && (hub->job.kind == TAXEL_JOB_POLL || hub->job.kind == TAXEL_JOB_PROBE_SLOT);
        const bool is_waiting =
            hub->unframed.size && hub->unframed.slot == i && hub->unframed.type != TAXEL_FRAME_TYPE_BOARD_INFO;
        const unsigned in_flight = (slot->retry_pending ? 1u : 0u) + (is_polled ? 1u : 0u) + (is_waiting ? 1u : 0u);
        FUZZ_CHECK(in_flight <= 1u);
        FUZZ_CHECK(slot->address >= TAXEL_ADDRESS_MIN && slot->address <= TAXEL_ADDRESS_MAX);
        FUZZ_CHECK(i == 0 || slot->address > slot[-1].address);
        FUZZ_CHECK(slot->state <= TAXEL_BOARD_STATE_INCOMPATIBLE &&
                   slot->polls == (uint8_t)(ENDED_COUNTERS(slot) + in_flight));
        FUZZ_CHECK(slot->state != TAXEL_BOARD_STATE_STREAMING ||
                   (slot->taxel_count >= 1 && slot->taxel_count <= TAXEL_TAXELS_MAX &&
                    10u + 2u * (size_t)slot->taxel_count <= taxel_hub_read_max(hub)));
    }
}

/* Check the hub's positions, counters and flow control after a pass of its main loop. */
static void check_hub(void)
{
    const struct taxel_hub *hub = &bench.hub;
    check_slots();
    FUZZ_CHECK(hub->outbox.head < bench.config.transmit_ring_size &&
               hub->outbox.tail < bench.config.transmit_ring_size);
    FUZZ_CHECK(taxel_hub_uart_pending(hub) == hub->outbox.bytes_sent - (uint32_t)bench.bytes_pulled);
    FUZZ_CHECK(hub->job.kind == TAXEL_JOB_NONE || hub->job.slot == TAXEL_NO_SLOT || hub->job.slot < hub->slot_count);
    FUZZ_CHECK(hub->cycle.position <= hub->slot_count && hub->inbox.commands_rejected <= hub->inbox.commands);
    FUZZ_CHECK(hub->job.kind == TAXEL_JOB_NONE || hub->job_done || bench.done_us != BENCH_NEVER);
    const unsigned waiting = (uint8_t)(hub->inbox.head - hub->inbox.tail);
    FUZZ_CHECK(hub->inbox.is_holding == bench.host_is_held);
    FUZZ_CHECK(bench.host_is_held || waiting < TAXEL_HUB_RECEIVE_RING - 1u - TAXEL_HUB_HOLD_SPACE);
    FUZZ_CHECK(!bench.host_is_held || bench.restarted ||
               waiting > TAXEL_HUB_RECEIVE_RING - 1u - TAXEL_HUB_RELEASE_SPACE);
}

/* One pass of the hub's main loop, with checks. */
void bench_pass(void)
{
    bench.wake_us = BENCH_NEVER;
    bench.clock_calls = 0;
    taxel_hub_run(&bench.hub);
    bench.now_us += RUN_COST_US;
    if (bench.host_reads) {
        bench_pull(SIZE_MAX);
    }
    check_hub();
    /* A hub that waits for a transfer, a reply or a board must have requested a wake-up: otherwise it never runs
     * again. */
    FUZZ_CHECK(bench.restarted || bench.wake_us != BENCH_NEVER || bench.done_us < BENCH_NEVER - 1u ||
               bench.hub.job_done);
}

/* Advance the simulated time to the next event, at most to `until_us`, and run the hub. Returns false if no event is
 * due until then. */
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

/* Encode a frame of the host with sequence number 0. Returns its length in bytes. */
size_t bench_frame(uint8_t type, const uint8_t *payload, size_t size, uint8_t *wire, size_t capacity)
{
    struct taxel_encoder encoder;
    FUZZ_CHECK(capacity >= taxel_encoded_size_max(size));
    taxel_encoder_begin(&encoder, wire, capacity, 0, type, 0, (uint16_t)size);
    taxel_encoder_put(&encoder, payload, size);
    return taxel_encoder_end(&encoder);
}

/* Reset bench and hub with the boards of bus number `bus`. */
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
        .handler = on_frame,
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

static void run_for(uint64_t microseconds)
{
    const uint64_t until = bench.now_us + microseconds;
    while (bench.now_us <= until && bench_step(until)) {
    }
}

/* Bring the hub into a state: started, handshake done, or streaming. */
static void warm_up(enum bench_state state)
{
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

static void copy_blocks(const struct blocks *to, const struct blocks *from)
{
    memcpy(to->slots, from->slots, bench.config.slot_capacity * sizeof *to->slots);
    memcpy(to->pool, from->pool, bench.config.transfer_pool_size);
    memcpy(to->ring, from->ring, bench.config.transmit_ring_size);
}

static struct blocks new_blocks(void)
{
    return (struct blocks){
        .slots = calloc(bench.config.slot_capacity, sizeof(struct taxel_hub_slot)),
        .pool = calloc(1, bench.config.transfer_pool_size),
        .ring = calloc(1, bench.config.transmit_ring_size),
    };
}

/* Restore a hub that has already reached `state`. The state is reached once per bus and copied afterwards, which makes
 * each fuzz input faster. */
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
