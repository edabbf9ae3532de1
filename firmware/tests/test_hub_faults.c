/* Boards that fail, are unplugged, replugged or restarted, and foreign devices: every poll is counted, and the other
 * boards are not affected. */
#include "check.h"
#include "fake_hub.h"

#define FIRST 0x20

static struct fake_hub fake;
static struct fake_sensor sensors[FAKE_DEVICES];

/* Start a hub that streams from this number of boards, and run two poll cycles. */
static void begin(size_t boards)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, boards);
    CHECK(fake_hub_start(&fake));
    CHECK(fake_hub_run_cycles(&fake, 2));
    fake_hub_forget_frames(&fake);
}

/* Check that counters balance, no frame is missing and no transfers overlapped, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    CHECK_EQUAL(fake.overlapping, 0);
    fake_hub_free_boards(&fake);
}

/* Return a copy of the hub's entry for the board with this address; all zero if there is none. */
static struct taxel_hub_slot slot(uint8_t address)
{
    const struct taxel_hub_slot none = {0};
    return fake_hub_slot(&fake, address) ? *fake_hub_slot(&fake, address) : none;
}

/* Return the number of polls of the board with this address. */
static uint32_t polls_of(uint8_t address)
{
    const struct taxel_hub_slot board = slot(address);
    return taxel_hub_polls(&board);
}

/* Return the number of the poll cycle in a TAXELS frame. */
static uint16_t cycle_of(const struct fake_frame *frame)
{
    return taxel_get_u16(frame->payload + TAXEL_TAXEL_HEADER_OFFSET_CYCLE);
}

/* Check that each poll of a board gave a frame; one poll may be in progress. */
static void check_every_poll_was_forwarded(uint8_t address)
{
    CHECK_BETWEEN(polls_of(address) - slot(address).forwarded, 0, 1);
}

/* Check that a board has at most one frame per cycle number: the frames of one cycle show the skin at one time. */
static void check_one_frame_per_cycle(uint8_t address)
{
    long last = -1;
    for (size_t i = 0; i < fake.frame_count; i++) {
        const struct fake_frame *frame = &fake.frames[i];
        if (frame->type == TAXEL_FRAME_TYPE_TAXELS && frame->payload[0] == address) {
            CHECK(cycle_of(frame) > last);
            last = cycle_of(frame);
        }
    }
}

/* Check that a poll that fails once per cycle, by a wrong CRC or a NACK, is repeated once and loses no
 * snapshot. */
static void check_one_retry(bool by_crc)
{
    begin(3);
    const struct taxel_hub_slot before = slot(FIRST + 2);
    for (unsigned i = 0; i < 40; i++) {
        fake.devices[2].corrupt = by_crc;
        fake.devices[2].nacks = !by_crc;
        CHECK(fake_hub_run_cycles(&fake, 1));
    }
    const struct taxel_hub_slot after = slot(FIRST + 2);
    CHECK_EQUAL(taxel_hub_polls(&after) - taxel_hub_polls(&before), 40);
    CHECK(after.retries - before.retries >= 30); /* sometimes the fault hits a reading of the clock instead */
    CHECK_EQUAL(after.crc_errors + after.nacks, 0);
    CHECK_EQUAL(after.forwarded, taxel_hub_polls(&after));
    CHECK_EQUAL(after.last_fault, TAXEL_BOARD_FAULT_NONE);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_FAULT), 0);
    check_one_frame_per_cycle(FIRST + 2);
    end();
}

static void a_damaged_snapshot_is_read_again(void)
{
    check_one_retry(true);
}

static void a_missing_acknowledge_causes_a_retry(void)
{
    check_one_retry(false);
}

static void a_retry_belongs_to_its_cycle_also_when_no_probe_follows(void)
{
    begin(FAKE_SLOTS); /* no free slot: no probes between the last poll and the next cycle */
    for (unsigned i = 0; i < 20; i++) {
        fake.devices[FAKE_SLOTS - 1].corrupt = 1;
        CHECK(fake_hub_run_cycles(&fake, 1));
    }
    CHECK(slot(FIRST + FAKE_SLOTS - 1).retries >= 15);
    CHECK(fake_hub_run_cycles(&fake, 2));
    check_one_frame_per_cycle(FIRST + FAKE_SLOTS - 1);
    end();
}

static void two_damaged_snapshots_are_one_crc_error(void)
{
    begin(2);
    fake.devices[0].corrupt = 2;
    CHECK(fake_hub_run_cycles(&fake, 4));
    CHECK_EQUAL(slot(FIRST).crc_errors, 1);
    CHECK_EQUAL(slot(FIRST).retries, 1);
    CHECK_EQUAL(slot(FIRST).state, TAXEL_BOARD_STATE_STREAMING);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_CRC), 1);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_RECOVERED), 1);
    end();
}

static void crc_errors_never_make_a_board_absent(void)
{
    begin(2);
    const uint32_t forwarded = slot(FIRST).forwarded;
    fake.devices[0].corrupt = 1000;
    CHECK(fake_hub_run_cycles(&fake, 50));
    CHECK_EQUAL(slot(FIRST).state, TAXEL_BOARD_STATE_STREAMING);
    CHECK(slot(FIRST).crc_errors >= 49);
    CHECK(slot(FIRST).forwarded <= forwarded + 1u);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_CRC), 1); /* once for consecutive failures */
    end();
}

static void an_unplugged_board_is_absent_after_three_failures_and_probed_each_cycle(void)
{
    begin(3);
    fake.devices[1].unplugged = true;
    CHECK(fake_hub_run_cycles(&fake, 2));
    CHECK(slot(FIRST + 1).state == TAXEL_BOARD_STATE_STREAMING);
    CHECK(fake_hub_run_cycles(&fake, 2));
    CHECK(slot(FIRST + 1).state == TAXEL_BOARD_STATE_ABSENT);
    const struct taxel_hub_slot before = slot(FIRST + 1);
    CHECK(fake_hub_run_cycles(&fake, 50));
    CHECK_EQUAL(slot(FIRST + 1).nacks - before.nacks, 50);
    CHECK_EQUAL(polls_of(FIRST + 1) - taxel_hub_polls(&before), 50);
    CHECK_EQUAL(slot(FIRST + 1).retries, before.retries);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_NACK), 1);
    check_every_poll_was_forwarded(FIRST);
    check_every_poll_was_forwarded(FIRST + 2);
    end();
}

static void a_replugged_board_streams_within_two_cycles(void)
{
    begin(3);
    for (size_t board = 0; board < 3; board++) {
        fake.devices[board].unplugged = true;
        CHECK(fake_hub_run_cycles(&fake, 10));
        fake_hub_forget_frames(&fake);
        fake.devices[board].unplugged = false;
        CHECK(fake_hub_run_cycles(&fake, 2));
        CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, (uint8_t)(FIRST + board)) >= 1);
        CHECK_EQUAL(fake_hub_count_faults(&fake, (uint8_t)(FIRST + board), TAXEL_BOARD_FAULT_RECOVERED), 1);
        CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), 1);
    }
    end();
}

/* A board that was just powered acknowledges its address but has no complete scan yet. */
static void a_board_streams_from_its_first_scan(void)
{
    begin(2);
    fake.devices[0].unplugged = true;
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake_sensor_boot(&sensors[0]), 0);
    fake.devices[0].unplugged = false;
    fake.devices[0].held_scans = 100000;
    CHECK(fake_hub_run_cycles(&fake, 50));
    fake_hub_forget_frames(&fake);
    fake.devices[0].held_scans = 0;
    CHECK(fake_hub_run_cycles(&fake, 2));
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST) >= 1);
    check_every_poll_was_forwarded(FIRST + 1);
    end();
}

static void two_boards_at_one_address_do_not_starve_the_others(void)
{
    begin(3);
    fake_sensor_init(&sensors[3], FIRST + 1, 3, 4, 5);
    sensors[3].config.unique_id[3] = 0x99;
    CHECK_EQUAL(fake_sensor_boot(&sensors[3]), 0);
    fake_scan(&sensors[3], 7);
    (void)fake_hub_add(&fake, FIRST + 1, &sensors[3]);
    const uint32_t forwarded = slot(FIRST + 1).forwarded;
    CHECK(fake_hub_run_cycles(&fake, 100));
    CHECK(slot(FIRST + 1).crc_errors > 90);
    CHECK(slot(FIRST + 1).forwarded <= forwarded + 1u);
    check_every_poll_was_forwarded(FIRST);
    check_every_poll_was_forwarded(FIRST + 2);
    end();
}

static void a_foreign_device_is_detected_and_not_polled(void)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, 2);
    fake_hub_add(&fake, 0x1C, NULL)->foreign = 0xA5;
    CHECK(fake_hub_start(&fake));
    CHECK(fake_hub_run_cycles(&fake, 70));
    CHECK_EQUAL(slot(0x1C).state, TAXEL_BOARD_STATE_INCOMPATIBLE);
    CHECK_EQUAL(slot(0x1C).last_fault, TAXEL_BOARD_FAULT_NOT_A_TAXEL_BOARD);
    const uint32_t polls = polls_of(0x1C);
    fake_hub_run(&fake, 10500000u);
    CHECK_EQUAL(polls_of(0x1C) - polls, 10); /* checked again every second */
    check_every_poll_was_forwarded(FIRST);
    CHECK_EQUAL(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, 0x1C), 0);
    end();
}

static void a_foreign_device_is_accepted_at_its_third_answer(void)
{
    begin(2);
    fake.hub.cycle.period_us = 50000u; /* addresses are probed in every cycle */
    fake_hub_add(&fake, 0x1C, NULL)->foreign = 0xA5;
    CHECK(fake_hub_run_cycles(&fake, 40));
    CHECK_EQUAL(slot(0x1C).state, TAXEL_BOARD_STATE_INCOMPATIBLE);
    CHECK_EQUAL(slot(0x1C).crc_errors, 3);
    end();
}

static void a_board_of_another_map_version_is_polled_after_its_update(void)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, 2);
    fake.devices[1].map_version = 9;
    CHECK(fake_hub_start(&fake));
    CHECK(fake_hub_run_cycles(&fake, 70));
    CHECK_EQUAL(slot(FIRST + 1).state, TAXEL_BOARD_STATE_INCOMPATIBLE);
    CHECK_EQUAL(slot(FIRST + 1).last_fault, TAXEL_BOARD_FAULT_MAP_VERSION);
    CHECK_EQUAL(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST + 1), 0);
    fake.devices[1].map_version = 0;
    CHECK_EQUAL(fake_sensor_boot(&sensors[1]), 0);
    fake_hub_run(&fake, 1200000u);
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST + 1) > 0);
    end();
}

int main(void)
{
    RUN(a_damaged_snapshot_is_read_again);
    RUN(a_missing_acknowledge_causes_a_retry);
    RUN(a_retry_belongs_to_its_cycle_also_when_no_probe_follows);
    RUN(two_damaged_snapshots_are_one_crc_error);
    RUN(crc_errors_never_make_a_board_absent);
    RUN(an_unplugged_board_is_absent_after_three_failures_and_probed_each_cycle);
    RUN(a_replugged_board_streams_within_two_cycles);
    RUN(a_board_streams_from_its_first_scan);
    RUN(two_boards_at_one_address_do_not_starve_the_others);
    RUN(a_foreign_device_is_detected_and_not_polled);
    RUN(a_foreign_device_is_accepted_at_its_third_answer);
    RUN(a_board_of_another_map_version_is_polled_after_its_update);
    return check_summary();
}
