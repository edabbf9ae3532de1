/* Faults of boards and of the host in the emulated world: delivered frames are intact, the counters are consistent, and
 * all boards stream again afterwards. */
#include "check.h"
#include "fake_world.h"

#define BOARDS 4
#define FAULTY 0x21 /* the board with the faults */
#define POSITIONS 40

static struct fake_world fake;

/* Describe a world of four boards, to which a test adds faults. */
static void describe_world(void)
{
    fake_world_describe(&fake, BOARDS, 40);
}

/* Create the described world, start the stream and run for a virtual time in seconds. */
static void start_and_run(double seconds)
{
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, seconds), 0);
}

/* Check that the counters are consistent, and that every board streams in the next 0.3 s. */
static void check_all_boards_stream_again(void)
{
    unsigned before[BOARDS];
    for (uint8_t i = 0; i < BOARDS; i++) {
        before[i] = fake.frames_of[0x20 + i];
    }
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    for (uint8_t i = 0; i < BOARDS; i++) {
        CHECK(fake.frames_of[0x20 + i] > before[i] + 10);
    }
    CHECK(fake_world_adds_up(&fake));
    fake_world_command(&fake, TAXEL_COMMAND_STOP, NULL, 0);
    CHECK_EQUAL(fake_world_run(&fake, 0.1), 0);
    CHECK(fake_world_adds_up(&fake));
}

/* Return time number `i` (seconds) at which a fault is injected. A poll cycle of four boards takes 9 ms: POSITIONS
 * times at intervals of 0.25 ms cover all of it. */
static double time_in_cycle_s(unsigned i)
{
    return 0.7 + 0.00025 * i;
}

static void board_streams_again_when_unplugged_and_plugged_at_any_time_of_a_cycle(void)
{
    for (unsigned i = 0; i < POSITIONS; i++) {
        describe_world();
        fake_world_fault(&fake, time_in_cycle_s(i), FAULT_UNPLUG, FAULTY, 0);
        fake_world_fault(&fake, time_in_cycle_s(i) + 0.0507, FAULT_PLUG, FAULTY, 0);
        start_and_run(0.4);
        CHECK(fake_world_slot(&fake, FAULTY)->nacks + fake_world_slot(&fake, FAULTY)->crc_errors > 0);
        CHECK_EQUAL(fake_world_slot(&fake, 0x20)->nacks, 0);
        check_all_boards_stream_again();
        fake_world_close(&fake);
    }
}

/* A recovery gives nine clocks, so a board that holds SDA for longer needs several recoveries. */
static void sda_held_for_some_clocks_is_recovered(void)
{
    static const unsigned clocks[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 25, 95};
    for (size_t n = 0; n < sizeof clocks / sizeof clocks[0]; n++) {
        for (unsigned i = 0; i < POSITIONS; i += 8) {
            describe_world();
            fake_world_fault(&fake, time_in_cycle_s(i), FAULT_HOLD_SDA, FAULTY, clocks[n]);
            start_and_run(0.6);
            CHECK(fake.world.hub.hub.bus_recoveries >= 1);
            if (clocks[n] <= 9) {
                CHECK_BETWEEN(fake.world.hub.hub.bus_recoveries, 1, 2);
            }
            check_all_boards_stream_again();
            fake_world_close(&fake);
        }
    }
}

static void restart_of_a_board_releases_a_held_sda_line(void)
{
    describe_world();
    fake_world_fault(&fake, 0.7, FAULT_HOLD_SDA, FAULTY, 1e9);
    fake_world_fault(&fake, 1.0, FAULT_RESTART, FAULTY, 0);
    start_and_run(0.9);
    check_all_boards_stream_again();
    fake_world_close(&fake);
}

static void clock_stretching_below_the_time_limit_causes_no_fault(void)
{
    describe_world();
    for (unsigned i = 0; i < POSITIONS; i++) {
        /* the interval exceeds a transfer */
        fake_world_fault(&fake, 0.7 + 0.012 * i, FAULT_STRETCH, FAULTY, 100.0 * i);
    }
    start_and_run(0.7);
    CHECK_EQUAL(fake_world_slot(&fake, FAULTY)->timeouts, 0);
    CHECK_EQUAL(fake.world.hub.hub.bus_recoveries, 0);
    check_all_boards_stream_again();
    fake_world_close(&fake);
}

static void clock_stretching_beyond_the_time_limit_is_recovered(void)
{
    for (unsigned i = 0; i < POSITIONS; i++) {
        describe_world();
        fake_world_fault(&fake, time_in_cycle_s(i), FAULT_STRETCH, FAULTY, 1e6);
        start_and_run(0.6);
        CHECK(fake.world.hub.hub.bus_recoveries >= 1);
        CHECK(fake_world_slot(&fake, FAULTY)->timeouts <= 1);
        check_all_boards_stream_again();
        fake_world_close(&fake);
    }
}

/* While the hub waits for the bus, it also runs for another reason: a command of a host that then sends nothing
 * more. */
static void endless_clock_stretching_does_not_stop_the_hub(void)
{
    for (unsigned i = 0; i < 20; i++) {
        describe_world();
        fake_world_fault(&fake, 0.7, FAULT_STRETCH, FAULTY, 1e9);
        CHECK_EQUAL(fake_world_open(&fake, -1), 0);
        CHECK(fake_world_start(&fake));
        CHECK_EQUAL(fake_world_run(&fake, 0.18 + 0.0007 * i), 0);
        fake_world_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0);
        CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
        CHECK(fake.world.hub.hub.bus_recoveries >= 1);
        check_all_boards_stream_again();
        fake_world_close(&fake);
    }
}

static void corrupted_snapshots_never_reach_the_host(void)
{
    describe_world();
    for (unsigned i = 0; i < 60; i++) {
        fake_world_fault(&fake, 0.7 + 0.01 * i, FAULT_CORRUPT, FAULTY, 1 + i % 7);
    }
    fake_world_fault(&fake, 1.3, FAULT_CORRUPT, FAULTY, 500); /* several consecutive snapshots */
    start_and_run(1.0);
    CHECK(fake_world_slot(&fake, FAULTY)->retries > 20);
    CHECK(fake_world_slot(&fake, FAULTY)->crc_errors > 0);
    CHECK_EQUAL(fake_world_slot(&fake, 0x22)->crc_errors, 0);
    check_all_boards_stream_again();
    fake_world_close(&fake);
}

static void each_address_without_acknowledge_is_counted(void)
{
    for (unsigned nacks = 1; nacks < 12; nacks++) {
        describe_world();
        fake_world_fault(&fake, 0.7, FAULT_NACK, FAULTY, nacks);
        start_and_run(0.4);
        const struct taxel_hub_slot *slot = fake_world_slot(&fake, FAULTY);
        CHECK_BETWEEN(slot->nacks + slot->retries, nacks - 1, nacks); /* one may affect the read of the board's clock */
        check_all_boards_stream_again();
        fake_world_close(&fake);
    }
}

static void restart_of_a_board_is_detected(void)
{
    for (unsigned i = 0; i < POSITIONS; i += 4) {
        describe_world();
        fake_world_fault(&fake, time_in_cycle_s(i), FAULT_RESTART, FAULTY, 0);
        start_and_run(0.4);
        CHECK(fake_world_slot(&fake, FAULTY)->last_fault == TAXEL_BOARD_FAULT_RESTARTED ||
              fake_world_slot(&fake, FAULTY)->nacks > 0);
        check_all_boards_stream_again();
        fake_world_close(&fake);
    }
}

static void host_that_does_not_read_loses_frames_and_receives_later_ones_in_order(void)
{
    describe_world();
    fake_world_fault(&fake, 0.7, FAULT_MUTE, 0, 1);
    fake_world_fault(&fake, 1.4, FAULT_MUTE, 0, 0);
    start_and_run(1.0);
    CHECK(fake_world_slot(&fake, 0x20)->dropped > 10);
    CHECK(fake.world.hub.hub.outbox.frames_dropped > 40);
    check_all_boards_stream_again();
    fake_world_close(&fake);
}

static void two_boards_with_one_address_deliver_no_frames(void)
{
    describe_world();
    fake.description.boards[3].address = FAULTY;
    fake.description.boards[3].unique_id[7] = 9;
    start_and_run(0.5);
    CHECK_EQUAL(fake.frames_of[FAULTY], 0);
    CHECK(fake.frames_of[0x20] > 30);
    CHECK(fake.frames_of[0x22] > 30);
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
}

static void board_with_another_map_version_is_incompatible(void)
{
    describe_world();
    fake.description.boards[1].map_version_override = 7;
    start_and_run(0.5);
    CHECK_EQUAL(fake_world_slot(&fake, FAULTY)->state, TAXEL_BOARD_STATE_INCOMPATIBLE);
    CHECK_EQUAL(fake.frames_of[FAULTY], 0);
    CHECK(fake.frames_of[0x22] > 30);
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
}

int main(void)
{
    RUN(board_streams_again_when_unplugged_and_plugged_at_any_time_of_a_cycle);
    RUN(sda_held_for_some_clocks_is_recovered);
    RUN(restart_of_a_board_releases_a_held_sda_line);
    RUN(clock_stretching_below_the_time_limit_causes_no_fault);
    RUN(clock_stretching_beyond_the_time_limit_is_recovered);
    RUN(endless_clock_stretching_does_not_stop_the_hub);
    RUN(corrupted_snapshots_never_reach_the_host);
    RUN(each_address_without_acknowledge_is_counted);
    RUN(restart_of_a_board_is_detected);
    RUN(host_that_does_not_read_loses_frames_and_receives_later_ones_in_order);
    RUN(two_boards_with_one_address_deliver_no_frames);
    RUN(board_with_another_map_version_is_incompatible);
    return check_summary();
}
