/* The hub, between a host that sends anything and a bus that answers anything.
 *
 * The first byte of the input chooses a bus and how far the hub has come on it (hub_bench.h); the rest is a script: bytes from the
 * host, handshakes and commands that are well formed, damaged or glued, results and damage of transfers, boards that come, go, restart
 * and refuse settings, lines held low, a UART that is read or not, time. Invariants, after each pass of the main loop:
 *   - each board's polls are its outcomes, and one more while one is under way;
 *   - slots are sorted, unique and no more than the hub was given; counts fit the buffers;
 *   - the transmit ring holds what was sent and not yet pulled, and everything pulled is whole frames in sequence, with the CRCs of
 *     boards right to the end;
 *   - one transfer at a time, into a buffer that nobody needs, and what it writes stays as it was until it has ended;
 *   - the main loop comes back, and never falls asleep for good.
 * And at the end: every frame sent was pulled; each command has one reply, or is still under way, or, only if the host glued frames
 * or lost bytes, its reply is among the frames dropped; on a bus that is well again, a command that is under way ends. */
#include "fuzz/hub_bench.h"

#define EVENTS_MAX 48u
#define STEPS_MAX 50u
#define QUIET_STEPS 8000u /* a board too large for the transmit ring costs 1000 a poll */
#define WIRE_MAX 96u

static unsigned steps;
static bool untidy; /* bytes were sent that are not one frame between two delimiters */

static void run(unsigned wanted)
{
    while (wanted-- && steps < STEPS_MAX && !bench.restarted && bench_step(BENCH_NEVER - 2u)) {
        steps++;
    }
}

static void send_bytes(struct fuzz_input *input, size_t wanted)
{
    uint8_t bytes[64];
    const size_t size = fuzz_bytes(input, bytes, wanted);
    untidy = true;
    bench_receive(bytes, size);
}

static size_t make_command(struct fuzz_input *input, uint8_t *wire)
{
    static const uint8_t lengths[16] = {0, 0, 0, 4, 0, 2, 9, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    const uint8_t what = fuzz_u8(input), tag = fuzz_u8(input);
    uint8_t payload[TAXEL_HUB_COMMAND_PAYLOAD_MAX] = {tag, what & 15u};
    const size_t more = what & 0x80u ? what >> 4 & 7u : 0; /* longer than it should be, or bytes to write */
    const size_t size = 2u + lengths[what & 15u] + more * (more == 7u ? 8u : 1u);
    (void)fuzz_bytes(input, payload + 2, size - 2u);
    bench.wants_compact = bench.wants_compact || (payload[1] == TAXEL_COMMAND_START && size == 3u && payload[2] == 1u);
    return bench_frame(TAXEL_FRAME_TYPE_COMMAND, payload, size, wire, WIRE_MAX);
}

static void send_command(struct fuzz_input *input, uint8_t form)
{
    uint8_t wire[2u * WIRE_MAX];
    size_t size = make_command(input, wire);
    if (form & 1u && form & 2u) { /* a second one behind it, no delimiter between */
        uint8_t second[WIRE_MAX];
        const size_t more = make_command(input, second) - 1u;
        memcpy(wire + size - 1u, second + 1, more);
        size += more - 1u;
        untidy = true;
    } else if (form == 2u) {
        wire[fuzz_u8(input) % size] ^= fuzz_u8(input);
        untidy = true;
    }
    bench_receive(wire, size);
}

static void send_acknowledge(struct fuzz_input *input, size_t count)
{
    uint8_t wire[WIRE_MAX], payload[3u * 8u];
    (void)fuzz_bytes(input, payload, sizeof payload);
    for (size_t i = 0; i < count; i++) {
        payload[3u * i] = (payload[3u * i] & 0x80u) | bench.boards[payload[3u * i] % BENCH_BOARDS].address;
    }
    bench_receive(wire, bench_frame(TAXEL_FRAME_TYPE_ACKNOWLEDGE, payload, 3u * count, wire, sizeof wire));
}

static void send_handshake(struct fuzz_input *input)
{
    uint8_t wire[WIRE_MAX], payload[3];
    (void)fuzz_bytes(input, payload, sizeof payload);
    bench_receive(wire, bench_frame(TAXEL_FRAME_TYPE_HOST_HANDSHAKE, payload, sizeof payload, wire, sizeof wire));
}

static void judge_transfer(struct fuzz_input *input, uint8_t high)
{
    static const int verdicts[16] = {
        BENCH_FLIP, BENCH_NOISE, BENCH_HANG, TAXEL_I2C_NACK_ADDRESS, TAXEL_I2C_NACK_DATA, TAXEL_I2C_ARBITRATION_LOST,
        TAXEL_I2C_BUS_ERROR, TAXEL_I2C_TIMEOUT, TAXEL_I2C_BUSY, BENCH_FLIP, BENCH_FLIP, BENCH_FLIP,
        TAXEL_I2C_NACK_ADDRESS, TAXEL_I2C_TIMEOUT, TAXEL_I2C_BUS_ERROR, BENCH_PROCEED,
    };
    bench.verdict = verdicts[high];
    bench.verdict_place = fuzz_u8(input);
    bench.verdict_value = fuzz_u8(input);
    run(1);
}

static void change_board(struct fuzz_input *input, uint8_t high)
{
    struct bench_board *board = &bench.boards[fuzz_u8(input) % BENCH_BOARDS];
    switch (high) {
    case 0:
    case 1:
        board->unplugged = !board->unplugged;
        break;
    case 2: /* it restarts */
        board->pointer = 0;
        board->sequence = 0;
        board->clock_offset_us = (uint32_t)-bench.now_us;
        break;
    case 3:
        board->rejects_settings = !board->rejects_settings;
        break;
    case 4:
        board->holds_scan = !board->holds_scan;
        break;
    case 5:
        board->map_version ^= 2u;
        break;
    case 6:
        board->foreign = !board->foreign;
        break;
    case 7:
        board->taxel_count = fuzz_u8(input) % (TAXEL_TAXELS_MAX + 1u);
        break;
    case 8:
        bench.sda_held_clocks = fuzz_u8(input) % 16u;
        break;
    case 9:
        bench.scl_held = !bench.scl_held;
        break;
    case 10:
        board->clock_offset_us += (uint32_t)fuzz_u8(input) << 16;
        break;
    default:
        board->settings[high & 7u] ^= fuzz_u8(input);
        break;
    }
}

static void event(struct fuzz_input *input)
{
    const uint8_t op = fuzz_u8(input), high = op >> 4;
    switch (op & 15u) {
    case 0:
    case 1:
        run(1u + high * 2u);
        break;
    case 2:
    case 3:
    case 4:
        judge_transfer(input, high);
        break;
    case 5:
        send_bytes(input, high + 1u);
        break;
    case 6:
    case 7:
    case 8:
        send_command(input, high & 3u);
        run(high >> 2);
        break;
    case 9:
        if (high & 8u) {
            send_acknowledge(input, 1u + (high & 7u));
        } else {
            send_handshake(input);
        }
        break;
    case 10:
        bench_pull((size_t)fuzz_u8(input) << (high & 3u));
        break;
    case 11:
        bench.now_us += (uint64_t)fuzz_u8(input) << high;
        bench_pass();
        break;
    case 12:
    case 13:
        change_board(input, high);
        break;
    case 14:
        bench.host_reads = high & 1u;
        break;
    default:
        run(8u * high);
        break;
    }
}

/* Boards as they are, no more faults, and a host that reads. */
static void run_quietly(void)
{
    bench.verdict = BENCH_PROCEED;
    bench.scl_held = false;
    bench.sda_held_clocks = 0;
    bench.host_reads = true;
    bench_pull(SIZE_MAX);
    for (unsigned i = 0; i < QUIET_STEPS && bench.hub.command.active && !bench.restarted && bench_step(BENCH_NEVER - 2u); i++) {
    }
    FUZZ_CHECK(!bench.hub.command.active || bench.hub.restart_wanted);
}

static void check_end(void)
{
    const struct taxel_hub *hub = &bench.hub;
    untidy = untidy || hub->inbox.overruns;
    bench_pull(SIZE_MAX);
    FUZZ_CHECK(bench.frames_pulled == hub->outbox.frames_sent && bench.bytes_pulled == hub->outbox.bytes_sent);
    const uint32_t lost = hub->inbox.commands - hub->command.active - bench.replies;
    FUZZ_CHECK(lost <= hub->outbox.frames_dropped && (untidy || lost == 0));
    FUZZ_CHECK(untidy || bench.replies_busy == 0); /* commands in frames of their own wait */
    FUZZ_CHECK(hub->inbox.commands_rejected >= bench.replies_bad && hub->inbox.commands_rejected <= bench.replies_bad + lost);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct fuzz_input input = {bytes, size};
    const uint8_t form = fuzz_u8(&input);
    bench_restore(form & 7u, (enum bench_state)((form >> 3 & 3u) % BENCH_STATES));
    bench.ends_at_once = (form & 0xE0u) == 0x20u;
    steps = 0;
    untidy = false;
    for (unsigned i = 0; input.left && i < EVENTS_MAX && !bench.restarted; i++) {
        event(&input);
    }
    if (!bench.restarted) {
        run_quietly();
    }
    check_end();
    return 0;
}
