/* Fuzz target: the hub between a host that sends any bytes and a bus that returns any bytes.
 *
 * The first byte of the input selects a bus and the hub's state on it (hub_bench.h); the other bytes are events:
 * bytes from the host; valid, damaged and concatenated handshakes and commands; results and damage of transfers;
 * boards that appear, disappear, restart and reject settings; lines held low; a UART with or without a reader; time.
 * Invariants, after each pass of the main loop:
 *   - each board's polls equal the sum of its outcomes, plus one for a poll in progress;
 *   - slots are sorted, unique and within the configured number; taxel counts fit the buffers;
 *   - the transmit queue holds the bytes sent and not yet pulled; the bytes pulled are complete frames in
 *     sequence with valid CRCs;
 *   - one transfer at a time, into an unused buffer, and its bytes to write do not change until its end;
 *   - the main loop returns, and always requests its next call.
 * At the end: every frame sent was pulled; each command has one reply, or is in progress, or (only after
 * concatenated frames or lost bytes) its reply is among the dropped frames; after the faults are removed, a command
 * in progress ends. */
#include "fuzz/hub_bench.h"

#define EVENTS_MAX 48u
#define STEPS_MAX 50u
#define QUIET_STEPS 8000u /* a board too large for the transmit ring takes 1000 steps per poll */
#define WIRE_MAX 96u

static unsigned steps;          /* events of the hub so far in this fuzz input, at most STEPS_MAX */
static bool sent_invalid_bytes; /* bytes that are not exactly one frame between two delimiters */

/* Run the hub for up to `count` of its events (ends of transfers and wake-ups). Stops earlier after STEPS_MAX events of
 * one fuzz input, at a restart of the hub, or when no event is due. The time limit BENCH_NEVER - 2 excludes two times
 * that are not events: BENCH_NEVER means no event, and BENCH_NEVER - 1 the end of a transfer that never ends. */
static void run_hub(unsigned count)
{
    while (count-- && steps < STEPS_MAX && !bench.restarted && bench_step(BENCH_NEVER - 2u)) {
        steps++;
    }
}

/* Send up to `size_max` raw bytes from the fuzz input to the hub, and remember that they may form no frame. */
static void send_bytes(struct fuzz_input *input, size_t size_max)
{
    uint8_t bytes[64];
    const size_t size = fuzz_bytes(input, bytes, size_max);
    sent_invalid_bytes = true;
    bench_receive(bytes, size);
}

/* Encode a COMMAND frame with code, tag and arguments from the fuzz input into `wire`, sometimes with excess bytes.
 * Also remembers that a START command with the COMPACT flag was sent. Returns the frame's size in bytes. */
static size_t make_command(struct fuzz_input *input, uint8_t *wire)
{
    /* number of argument bytes of the command with each code from 0 to 15 */
    static const uint8_t lengths[16] = {0, 0, 0, 4, 0, 2, 9, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    const uint8_t selector = fuzz_u8(input), tag = fuzz_u8(input);
    uint8_t payload[TAXEL_HUB_COMMAND_PAYLOAD_MAX] = {tag, selector & 15u};
    const size_t more = selector & 0x80u ? selector >> 4 & 7u : 0; /* number of excess bytes, or of bytes that an I2C
                                                                    * transfer writes; 7 stands for 56 bytes */
    const size_t size = 2u + lengths[selector & 15u] + more * (more == 7u ? 8u : 1u);
    (void)fuzz_bytes(input, payload + 2, size - 2u);
    bench.compact_requested =
        bench.compact_requested || (payload[1] == TAXEL_COMMAND_START && size == 3u && payload[2] == 1u);
    return bench_frame(TAXEL_FRAME_TYPE_COMMAND, payload, size, wire, WIRE_MAX);
}

/* Send one command to the hub. variant: 0 and 1 send the command unchanged, 2 damages one byte, 3 sends two commands
 * without a delimiter between them. */
static void send_command(struct fuzz_input *input, uint8_t variant)
{
    uint8_t wire[2u * WIRE_MAX];
    size_t size = make_command(input, wire);
    if (variant & 1u && variant & 2u) {
        uint8_t second[WIRE_MAX];
        const size_t more = make_command(input, second) - 1u;
        memcpy(wire + size - 1u, second + 1, more);
        size += more - 1u;
        sent_invalid_bytes = true;
    } else if (variant == 2u) {
        wire[fuzz_u8(input) % size] ^= fuzz_u8(input);
        sent_invalid_bytes = true;
    }
    bench_receive(wire, size);
}

/* Send an ACKNOWLEDGE frame with `count` entries of three bytes for boards on the bus: I2C address with a flag in bit
 * 7, and two bytes from the fuzz input. */
static void send_acknowledge(struct fuzz_input *input, size_t count)
{
    uint8_t wire[WIRE_MAX], payload[3u * 8u];
    (void)fuzz_bytes(input, payload, sizeof payload);
    for (size_t i = 0; i < count; i++) {
        payload[3u * i] = (payload[3u * i] & 0x80u) | bench.boards[payload[3u * i] % BENCH_BOARDS].address;
    }
    bench_receive(wire, bench_frame(TAXEL_FRAME_TYPE_ACKNOWLEDGE, payload, 3u * count, wire, sizeof wire));
}

/* Send a HOST_HANDSHAKE frame whose three payload bytes come from the fuzz input. */
static void send_handshake(struct fuzz_input *input)
{
    uint8_t wire[WIRE_MAX], payload[3];
    (void)fuzz_bytes(input, payload, sizeof payload);
    bench_receive(wire, bench_frame(TAXEL_FRAME_TYPE_HOST_HANDSHAKE, payload, sizeof payload, wire, sizeof wire));
}

/* Select the result of the next I2C transfer (a fault, a damaged byte, random bytes, a transfer that never ends, or no
 * fault) by the 4-bit number `selector`, then run the hub for one event, at which the result may take effect. */
static void choose_outcome_and_run(struct fuzz_input *input, uint8_t selector)
{
    static const int outcomes[16] = {
        BENCH_FLIP,
        BENCH_NOISE,
        BENCH_HANG,
        TAXEL_I2C_NACK_ADDRESS,
        TAXEL_I2C_NACK_DATA,
        TAXEL_I2C_ARBITRATION_LOST,
        TAXEL_I2C_BUS_ERROR,
        TAXEL_I2C_TIMEOUT,
        TAXEL_I2C_BUSY,
        BENCH_FLIP,
        BENCH_FLIP,
        BENCH_FLIP,
        TAXEL_I2C_NACK_ADDRESS,
        TAXEL_I2C_TIMEOUT,
        TAXEL_I2C_BUS_ERROR,
        BENCH_PROCEED,
    };
    bench.outcome = outcomes[selector];
    bench.damage_position = fuzz_u8(input);
    bench.damage_value = fuzz_u8(input);
    run_hub(1);
}

/* Change a board or the bus as a fault or a user would, selected by the 4-bit number `selector`: unplug or restart a
 * board, let it reject settings or repeat its last scan, exchange it for a board with an unsupported register map,
 * another kind of device or a board with another number of taxels, shift its clock, change its settings, or hold SDA or
 * SCL low. */
static void change_board_or_bus(struct fuzz_input *input, uint8_t selector)
{
    struct bench_board *board = &bench.boards[fuzz_u8(input) % BENCH_BOARDS];
    switch (selector) {
    case 0:
    case 1:
        board->unplugged = !board->unplugged;
        break;
    case 2: /* restart */
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
        board->settings[selector & 7u] ^= fuzz_u8(input);
        break;
    }
}

/* Execute one event from the fuzz input: events of the hub, a fault of a transfer, bytes or a frame of the host, bytes
 * that the host reads, elapsed time, or a changed board or bus. */
static void run_event(struct fuzz_input *input)
{
    const uint8_t op = fuzz_u8(input), high = op >> 4;
    switch (op & 15u) {
    case 0:
    case 1:
        run_hub(1u + high * 2u);
        break;
    case 2:
    case 3:
    case 4:
        choose_outcome_and_run(input, high);
        break;
    case 5:
        send_bytes(input, high + 1u);
        break;
    case 6:
    case 7:
    case 8:
        send_command(input, high & 3u);
        run_hub(high >> 2);
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
        change_board_or_bus(input, high);
        break;
    case 14:
        bench.host_reads = high & 1u;
        break;
    default:
        run_hub(8u * high);
        break;
    }
}

/* Remove all faults of the bus, let the host read, and run until the command in progress ends. The command must end
 * within QUIET_STEPS events, or by a restart that it requested. The time limit of bench_step() is that of run_hub(). */
static void run_without_faults(void)
{
    bench.outcome = BENCH_PROCEED;
    bench.scl_held = false;
    bench.sda_held_clocks = 0;
    bench.host_reads = true;
    bench_pull(SIZE_MAX);
    for (unsigned i = 0;
         i < QUIET_STEPS && bench.hub.command.active && !bench.restarted && bench_step(BENCH_NEVER - 2u); i++) {
    }
    FUZZ_CHECK(!bench.hub.command.active || bench.hub.restart_requested);
}

/* Take all bytes from the hub and check the final counters: frames and bytes pulled equal those sent. `lost` is the
 * number of commands without a reply. This number is 0 if the host sent only valid bytes, and otherwise at most the
 * number of dropped frames. The hub has rejected at least the commands with a failure reply, and at most the lost
 * commands in addition. */
static void check_end(void)
{
    const struct taxel_hub *hub = &bench.hub;
    sent_invalid_bytes = sent_invalid_bytes || hub->inbox.overruns;
    bench_pull(SIZE_MAX);
    FUZZ_CHECK(bench.frames_pulled == hub->outbox.frames_sent && bench.bytes_pulled == hub->outbox.bytes_sent);
    const uint32_t lost = hub->inbox.commands - hub->command.active - bench.replies;
    FUZZ_CHECK(lost <= hub->outbox.frames_dropped && (sent_invalid_bytes || lost == 0));
    FUZZ_CHECK(sent_invalid_bytes ||
               bench.replies_busy == 0); /* a command in a frame of its own waits instead of BUSY */
    FUZZ_CHECK(hub->inbox.commands_rejected >= bench.replies_bad &&
               hub->inbox.commands_rejected <= bench.replies_bad + lost);
}

/* Run one fuzz input: a hub with simulated boards, started in one of several states, with faults and commands. The
 * first byte selects the bus (bits 0 to 2) and the state of the hub (bits 3 and 4); with the value 1 in bits 5 to 7,
 * transfers end at once. After the faults are removed, a command in progress must end. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct fuzz_input input = {bytes, size};
    const uint8_t start = fuzz_u8(&input);
    bench_restore(start & 7u, (enum bench_state)((start >> 3 & 3u) % BENCH_STATES));
    bench.ends_at_once = (start & 0xE0u) == 0x20u;
    steps = 0;
    sent_invalid_bytes = false;
    for (unsigned i = 0; input.remaining && i < EVENTS_MAX && !bench.restarted; i++) {
        run_event(&input);
    }
    if (!bench.restarted) {
        run_without_faults();
    }
    check_end();
    return 0;
}
