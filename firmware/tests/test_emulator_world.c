/* The emulated world without faults: reproducible bytes, the expected rate, and intact frames. */
#include "check.h"
#include "fake_world.h"

#define HAND_BOARDS 17

static struct fake_world fake;

/* Describe a world of 17 boards with 15 x 63 + 2 x 64 = 1073 taxels, a load similar to that of a whole hand. */
static void describe_hand(void)
{
    fake_world_describe(&fake, HAND_BOARDS, 63);
    for (size_t i = 0; i < 2; i++) {
        fake.description.boards[i].taxel_count = 64;
        fake.description.boards[i].crossing_map[7] |= 0x80;
    }
}

/* Stop the stream; all queued bytes must arrive, and the counters must agree. */
static void stop_stream(void)
{
    fake_world_command(&fake, TAXEL_COMMAND_STOP, NULL, 0);
    CHECK_EQUAL(fake_world_run(&fake, 0.1), 0);
    CHECK_EQUAL(fake.world.uart.packet_fill, 0);
    CHECK(fake_world_adds_up(&fake));
}

static void hand_streams_at_the_rate_of_bus_and_hub(void)
{
    describe_hand();
    CHECK_EQUAL(world_taxel_count(&fake.description), 1073);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    const uint32_t cycles = fake.world.hub.hub.cycle.count;
    CHECK_EQUAL(fake_world_run(&fake, 2.0), 0);
    const double rate = (fake.world.hub.hub.cycle.count - cycles) / 2.0;
    /* 17 x (1 + 10) + 2 x 1073 bytes of nine clocks take 52.5 ms per cycle; in addition there are a pass of the hub's
     * main loop between two polls, probes and one read of a clock. */
    CHECK_BETWEEN(rate, 17.5, 18.7);
    for (uint8_t i = 0; i < HAND_BOARDS; i++) {
        CHECK(fake_world_slot(&fake, (uint8_t)(0x20 + i))->forwarded >= 34);
        CHECK_EQUAL(fake_world_slot(&fake, (uint8_t)(0x20 + i))->crc_errors, 0);
    }
    stop_stream();
    fake_world_close(&fake);
}

/* Run a world with several faults in steps of this size. Returns the CRC of the bytes from the hub; writes their number
 * to *bytes. */
static uint32_t run_with_faults(double seconds, vtime step, uint64_t seed, uint64_t *bytes)
{
    fake_world_describe(&fake, 6, 20);
    fake.description.seed = seed;
    fake.description.boards[1].clock_ppm = 800.0;
    fake.description.hub_clock_ppm = -50.0;
    fake_world_fault(&fake, 0.8, FAULT_CORRUPT, 0x21, 3);
    fake_world_fault(&fake, 0.9, FAULT_HOLD_SDA, 0x22, 5);
    fake_world_fault(&fake, 0.95, FAULT_UNPLUG, 0x23, 0);
    fake_world_fault(&fake, 1.1, FAULT_PLUG, 0x23, 0);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run_in_steps(&fake, seconds, step), 0);
    stop_stream();
    *bytes = fake.stream_bytes;
    const uint32_t crc = fake.stream_crc;
    fake_world_close(&fake);
    return crc;
}

static void seed_determines_the_bytes_of_the_stream(void)
{
    uint64_t bytes[3];
    const uint32_t first = run_with_faults(1.0, 2 * VTIME_MS, 7, &bytes[0]);
    const uint32_t second = run_with_faults(1.0, 2 * VTIME_MS, 7, &bytes[1]);
    CHECK(bytes[0] > 10000);
    CHECK_EQUAL(bytes[0], bytes[1]);
    CHECK_EQUAL(first, second);
    CHECK(run_with_faults(1.0, 2 * VTIME_MS, 8, &bytes[2]) != first);
}

static void step_length_does_not_change_the_stream(void)
{
    uint64_t bytes[2];
    const uint32_t whole = run_with_faults(1.0, VTIME_SECOND, 7, &bytes[0]);
    static const vtime steps[] = {37 * VTIME_US, VTIME_MS, 2 * VTIME_MS, 17 * VTIME_MS};
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        const uint32_t stepped = run_with_faults(1.0, steps[i], 7, &bytes[1]);
        CHECK_EQUAL(bytes[1], bytes[0]);
        CHECK_EQUAL(stepped, whole);
    }
}

/* Return the CRC of the hub's bytes in a world that is run in steps of this size. The host's commands reach the hub
 * during an I2C transfer; the result must not depend on how far the bus has been advanced by then. */
static uint32_t run_with_commands(vtime step)
{
    fake_world_describe(&fake, 4, 200);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    for (unsigned i = 0; i < 20; i++) {
        fake_world_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0);
        CHECK_EQUAL(fake_world_run_in_steps(&fake, 0.034, step), 0);
    }
    CHECK_EQUAL(fake.replies, 21);
    stop_stream();
    const uint32_t crc = fake.stream_crc;
    fake_world_close(&fake);
    return crc;
}

static void step_length_does_not_change_responses_to_commands(void)
{
    const uint32_t fine = run_with_commands(50 * VTIME_US);
    CHECK_EQUAL(run_with_commands(VTIME_MS), fine);
    CHECK_EQUAL(run_with_commands(34 * VTIME_MS), fine);
}

static void worlds_of_1_taxel_and_of_7680_taxels_stream(void)
{
    fake_world_describe(&fake, 1, 1);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.2), 0);
    CHECK(fake.frames_of[0x20] > 100);
    stop_stream();
    fake_world_close(&fake);
    fake_world_describe(&fake, 32, 240);
    fake.description.scl_hz = 1e6;
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
    for (uint8_t i = 0; i < 32; i++) {
        CHECK(fake.frames_of[0x20 + i] >= 2);
    }
    stop_stream();
    fake_world_close(&fake);
}

static void uart_slower_than_the_bus_serves_all_boards_equally(void)
{
    fake_world_describe(&fake, 8, 60);
    fake.description.baud = 115200.0;
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 2.0), 0);
    CHECK(fake.taxel_frames > 100);
    for (uint8_t i = 1; i < 8; i++) {
        CHECK_BETWEEN(fake.frames_of[0x20 + i], fake.frames_of[0x20] - 2.0, fake.frames_of[0x20] + 2.0);
    }
    CHECK(fake_world_adds_up(&fake));
    fake_world_command(&fake, TAXEL_COMMAND_STOP, NULL, 0);
    CHECK_EQUAL(fake_world_run(&fake, 0.5), 0);
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
}

static void reboot_of_the_hub_stops_the_stream_and_finds_all_boards(void)
{
    fake_world_describe(&fake, 3, 30);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    fake_world_command(&fake, TAXEL_COMMAND_REBOOT, NULL, 0);
    CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
    CHECK_EQUAL(fake.restarts, 2);
    CHECK(!fake.world.hub.hub.streaming);
    CHECK_EQUAL(fake.world.hub.hub.slot_count, 3);
    fake_world_close(&fake);
}

int main(void)
{
    RUN(hand_streams_at_the_rate_of_bus_and_hub);
    RUN(seed_determines_the_bytes_of_the_stream);
    RUN(step_length_does_not_change_the_stream);
    RUN(step_length_does_not_change_responses_to_commands);
    RUN(worlds_of_1_taxel_and_of_7680_taxels_stream);
    RUN(uart_slower_than_the_bus_serves_all_boards_equally);
    RUN(reboot_of_the_hub_stops_the_stream_and_finds_all_boards);
    return check_summary();
}
