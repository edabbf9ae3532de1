/* Faults injected into the emulated world: what is delivered is whole, the counters add up, and the stream goes on. */
#include "check.h"
#include "fake_world.h"

#define BOARDS 4
#define BAD 0x21 /* the board that the faults strike */

static struct fake_world fake;

static void begin(void)
{
    fake_world_describe(&fake, BOARDS, 40);
}

static void run(double seconds)
{
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, seconds), 0);
}

/* Everything adds up, and in the last stretch of the run every board streams again. */
static void check_recovered(void)
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

static void end(void)
{
    fake_world_close(&fake);
}

/* A cycle of four boards takes 9 ms: 40 times, 0.25 ms apart, strike every place of it. */
static double place_of(unsigned i)
{
    return 0.7 + 0.00025 * i;
}

static void unplugged_and_plugged_at_every_place_of_a_cycle(void)
{
    for (unsigned i = 0; i < 40; i++) {
        begin();
        fake_world_fault(&fake, place_of(i), FAULT_UNPLUG, BAD, 0);
        fake_world_fault(&fake, place_of(i) + 0.0507, FAULT_PLUG, BAD, 0);
        run(0.4);
        CHECK(fake_world_slot(&fake, BAD)->nacks + fake_world_slot(&fake, BAD)->crc_errors > 0);
        CHECK_EQUAL(fake_world_slot(&fake, 0x20)->nacks, 0);
        check_recovered();
        end();
    }
}

static void sda_held_for_some_clocks(void)
{
    static const unsigned clocks[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 25, 95};
    for (size_t n = 0; n < sizeof clocks / sizeof clocks[0]; n++) {
        for (unsigned i = 0; i < 40; i += 8) {
            begin();
            fake_world_fault(&fake, place_of(i), FAULT_HOLD_SDA, BAD, clocks[n]);
            run(0.6);
            CHECK(fake.world.hub.hub.bus_recoveries >= 1);
            if (clocks[n] <= 9) {
                CHECK_BETWEEN(fake.world.hub.hub.bus_recoveries, 1, 2);
            }
            check_recovered();
            end();
        }
    }
}

static void a_restart_frees_a_held_line(void)
{
    begin();
    fake_world_fault(&fake, 0.7, FAULT_HOLD_SDA, BAD, 1e9);
    fake_world_fault(&fake, 1.0, FAULT_RESTART, BAD, 0);
    run(0.9);
    check_recovered();
    end();
}

static void the_clock_stretched_below_the_time_limit_costs_nothing(void)
{
    begin();
    for (unsigned i = 0; i < 40; i++) {
        fake_world_fault(&fake, 0.7 + 0.012 * i, FAULT_STRETCH, BAD, 100.0 * i); /* not two in one transfer */
    }
    run(0.7);
    CHECK_EQUAL(fake_world_slot(&fake, BAD)->timeouts, 0);
    CHECK_EQUAL(fake.world.hub.hub.bus_recoveries, 0);
    check_recovered();
    end();
}

static void the_clock_stretched_beyond_the_time_limit_is_given_up(void)
{
    for (unsigned i = 0; i < 40; i++) {
        begin();
        fake_world_fault(&fake, place_of(i), FAULT_STRETCH, BAD, 1e6);
        run(0.6);
        CHECK(fake.world.hub.hub.bus_recoveries >= 1);
        CHECK(fake_world_slot(&fake, BAD)->timeouts <= 1);
        check_recovered();
        end();
    }
}

/* Also when the hub has meanwhile run for another reason than the bus: here bytes from a host that then falls silent. */
static void a_clock_stretched_for_ever_does_not_stop_the_hub(void)
{
    for (unsigned i = 0; i < 20; i++) {
        begin();
        fake_world_fault(&fake, 0.7, FAULT_STRETCH, BAD, 1e9);
        CHECK_EQUAL(fake_world_open(&fake, -1), 0);
        CHECK(fake_world_start(&fake));
        CHECK_EQUAL(fake_world_run(&fake, 0.18 + 0.0007 * i), 0);
        fake_world_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0);
        CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
        CHECK(fake.world.hub.hub.bus_recoveries >= 1);
        check_recovered();
        end();
    }
}

static void corrupt_bytes_never_reach_the_host(void)
{
    begin();
    for (unsigned i = 0; i < 60; i++) {
        fake_world_fault(&fake, 0.7 + 0.01 * i, FAULT_CORRUPT, BAD, 1 + i % 7);
    }
    fake_world_fault(&fake, 1.3, FAULT_CORRUPT, BAD, 500); /* several snapshots in a row */
    run(1.0);
    CHECK(fake_world_slot(&fake, BAD)->retries > 20);
    CHECK(fake_world_slot(&fake, BAD)->crc_errors > 0);
    CHECK_EQUAL(fake_world_slot(&fake, 0x22)->crc_errors, 0);
    check_recovered();
    end();
}

static void addresses_not_acknowledged(void)
{
    for (unsigned nacks = 1; nacks < 12; nacks++) {
        begin();
        fake_world_fault(&fake, 0.7, FAULT_NACK, BAD, nacks);
        run(0.4);
        const struct taxel_hub_slot *slot = fake_world_slot(&fake, BAD);
        CHECK_BETWEEN(slot->nacks + slot->retries, nacks - 1, nacks); /* one may have met the read of its clock */
        check_recovered();
        end();
    }
}

static void a_restart_of_a_board(void)
{
    for (unsigned i = 0; i < 40; i += 4) {
        begin();
        fake_world_fault(&fake, place_of(i), FAULT_RESTART, BAD, 0);
        run(0.4);
        CHECK(fake_world_slot(&fake, BAD)->last_fault == TAXEL_BOARD_FAULT_RESTARTED ||
              fake_world_slot(&fake, BAD)->nacks > 0);
        check_recovered();
        end();
    }
}

static void a_host_that_does_not_read_costs_frames_but_no_order(void)
{
    begin();
    fake_world_fault(&fake, 0.7, FAULT_MUTE, 0, 1);
    fake_world_fault(&fake, 1.4, FAULT_MUTE, 0, 0);
    run(1.0);
    CHECK(fake_world_slot(&fake, 0x20)->dropped > 10);
    CHECK(fake.world.hub.hub.outbox.frames_dropped > 40);
    check_recovered();
    end();
}

static void two_boards_at_one_address(void)
{
    begin();
    fake.description.boards[3].address = BAD;
    fake.description.boards[3].unique_id[7] = 9;
    run(0.5);
    CHECK_EQUAL(fake.frames_of[BAD], 0);
    CHECK(fake.frames_of[0x20] > 30);
    CHECK(fake.frames_of[0x22] > 30);
    CHECK(fake_world_adds_up(&fake));
    end();
}

static void a_board_of_another_map_version(void)
{
    begin();
    fake.description.boards[1].map_version_override = 7;
    run(0.5);
    CHECK_EQUAL(fake_world_slot(&fake, BAD)->state, TAXEL_BOARD_STATE_INCOMPATIBLE);
    CHECK_EQUAL(fake.frames_of[BAD], 0);
    CHECK(fake.frames_of[0x22] > 30);
    CHECK(fake_world_adds_up(&fake));
    end();
}

int main(void)
{
    RUN(unplugged_and_plugged_at_every_place_of_a_cycle);
    RUN(sda_held_for_some_clocks);
    RUN(a_restart_frees_a_held_line);
    RUN(the_clock_stretched_below_the_time_limit_costs_nothing);
    RUN(the_clock_stretched_beyond_the_time_limit_is_given_up);
    RUN(a_clock_stretched_for_ever_does_not_stop_the_hub);
    RUN(corrupt_bytes_never_reach_the_host);
    RUN(addresses_not_acknowledged);
    RUN(a_restart_of_a_board);
    RUN(a_host_that_does_not_read_costs_frames_but_no_order);
    RUN(two_boards_at_one_address);
    RUN(a_board_of_another_map_version);
    return check_summary();
}
