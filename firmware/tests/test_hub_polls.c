/* The hub's poll cycle without faults: detection of boards, order, numbering, clocks, rate. */
#include "check.h"
#include "fake_hub.h"

#define BOARDS 5u
#define FIRST 0x20
#define UPKEEP_US 50000u /* shortest interval between two clock readings */

static struct fake_hub fake;
static struct fake_sensor sensors[FAKE_DEVICES];

/* Start a hub that streams from this number of boards. */
static void begin(size_t boards)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, boards);
    CHECK(fake_hub_start(&fake));
}

/* Check that counters balance, no frame or byte is lost and no transfers overlapped, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    CHECK_EQUAL(fake.overlapping, 0);
    CHECK_EQUAL(fake.deframer.discarded_bytes, 0);
    fake_hub_free_boards(&fake);
}

static void a_handshake_frame_announces_the_start(void)
{
    fake_hub_init(&fake);
    fake_hub_boot(&fake);
    fake_hub_run(&fake, 1000);
    struct taxel_hub_handshake handshake;
    CHECK_EQUAL(fake.frame_count, 1);
    CHECK_EQUAL(fake.frames[0].type, TAXEL_FRAME_TYPE_HUB_HANDSHAKE);
    taxel_hub_handshake_unpack(&handshake, fake.frames[0].payload);
    CHECK_EQUAL(handshake.tag, 0);
    CHECK_EQUAL(handshake.version_chosen, 0);
    CHECK_EQUAL(handshake.reset_cause, TAXEL_RESET_CAUSE_BROWN_OUT);
    CHECK_EQUAL(handshake.firmware_patch, 6);
    CHECK_EQUAL(handshake.uptime_us, 1000);
    CHECK_BYTES(handshake.unique_id, fake.config.unique_id, 8);
    end();
}

static void boards_are_detected_and_identified_before_streaming(void)
{
    uint8_t identity[TAXEL_IDENTITY_SIZE];
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, BOARDS);
    (void)fake_hub_add(&fake, 0x77, &sensors[BOARDS]);
    fake_sensor_init(&sensors[BOARDS], 0x77, 16, 15, 0);
    CHECK_EQUAL(fake_sensor_boot(&sensors[BOARDS]), 0);
    fake_hub_boot(&fake);
    fake_hub_run(&fake, 100000);
    CHECK_EQUAL(fake.hub.slot_count, BOARDS + 1);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), BOARDS + 1);
    for (size_t i = 0; i < fake.frame_count; i++) {
        const struct fake_frame *frame = &fake.frames[i];
        if (frame->type == TAXEL_FRAME_TYPE_BOARD_INFO) {
            struct fake_sensor *sensor =
                &sensors[frame->payload[TAXEL_IDENTITY_OFFSET_ADDRESS] == 0x77
                             ? BOARDS
                             : (size_t)(frame->payload[TAXEL_IDENTITY_OFFSET_ADDRESS] - FIRST)];
            CHECK(fake_read_at(sensor, 0, identity, sizeof identity));
            CHECK_BYTES(frame->payload, identity, sizeof identity);
            CHECK_EQUAL(taxel_get_u16(frame->payload + TAXEL_IDENTITY_SIZE), 160);
        }
    }
    for (uint8_t i = 1; i < fake.hub.slot_count; i++) {
        CHECK(fake.slots[i].address > fake.slots[i - 1].address);
        CHECK_EQUAL(fake.slots[i].state, TAXEL_BOARD_STATE_STREAMING);
    }
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_TAXELS), 0);
    end();
}

static void every_cycle_polls_every_board_in_the_order_of_addresses(void)
{
    struct taxel_taxel_header header;
    begin(BOARDS);
    CHECK(fake_hub_run_cycles(&fake, 100));
    unsigned n = 0;
    for (size_t i = 0; i < fake.frame_count; i++) {
        if (fake.frames[i].type == TAXEL_FRAME_TYPE_TAXELS) {
            taxel_taxel_header_unpack(&header, fake.frames[i].payload);
            CHECK_EQUAL(header.address, FIRST + n % BOARDS);
            CHECK_EQUAL(header.cycle, n / BOARDS);
            CHECK_EQUAL(header.taxel_count, 10);
            CHECK(fake_snapshot_is_valid(&sensors[n % BOARDS], fake.frames[i].payload + TAXEL_TAXEL_HEADER_SIZE));
            n++;
        }
    }
    CHECK_EQUAL(n, 100 * BOARDS);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST)->forwarded, 100);
    end();
}

static unsigned pointer_writes;

/* Count the polls that write the register pointer first; script of the bus. */
static int count_pointer_writes(struct fake_hub *hub, const struct taxel_i2c_transfer *transfer)
{
    (void)hub;
    pointer_writes += transfer->read_size == TAXEL_SNAPSHOT_SIZE(10) && transfer->write_size;
    return FAKE_PROCEED;
}

static void a_poll_writes_the_pointer_only_if_it_was_moved(void)
{
    begin(BOARDS);
    CHECK(fake_hub_run_cycles(&fake, 5));
    pointer_writes = 0;
    fake.script = count_pointer_writes;
    const uint64_t start_us = fake.now_us;
    CHECK(fake_hub_run_cycles(&fake, 100));
    const double clocks = (double)(fake.now_us - start_us) / UPKEEP_US;
    CHECK(clocks >= 3);
    CHECK_BETWEEN(pointer_writes, clocks - 1, clocks + 1); /* after the read of one board's clock */
    end();
}

static void a_cycle_of_50_ms_reads_one_boards_clock(void)
{
    begin(BOARDS);
    fake.hub.cycle.period_us = UPKEEP_US;
    sensors[2].clock_us = 0;
    for (size_t i = 0; i < BOARDS; i++) {
        fake.devices[i].clock_offset_us = 1000000u * (uint32_t)i;
    }
    CHECK(fake_hub_run_cycles(&fake, 10 * BOARDS));
    for (uint8_t i = 0; i < BOARDS; i++) {
        CHECK_BETWEEN(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TIME_SYNC, (uint8_t)(FIRST + i)), 9, 11);
    }
    for (size_t i = 0; i < fake.frame_count; i++) {
        struct taxel_time_sync sync;
        if (fake.frames[i].type == TAXEL_FRAME_TYPE_TIME_SYNC) {
            taxel_time_sync_unpack(&sync, fake.frames[i].payload);
            const uint32_t offset = 1000000u * (sync.address - FIRST);
            /* two bytes on the bus */
            CHECK_BETWEEN((int32_t)(sync.board_time_us - (uint32_t)sync.hub_time_us - offset), -50, 50);
        }
    }
    end();
}

static void a_board_without_a_newer_scan_is_counted_as_repeated(void)
{
    begin(2);
    CHECK(fake_hub_run_cycles(&fake, 2));
    const struct taxel_hub_slot before = *fake_hub_slot(&fake, FIRST);
    fake.devices[0].held_scans = 1000;
    CHECK(fake_hub_run_cycles(&fake, 20));
    const struct taxel_hub_slot after = *fake_hub_slot(&fake, FIRST);
    CHECK_EQUAL(taxel_hub_polls(&after) - taxel_hub_polls(&before), 20);
    CHECK(after.repeated - before.repeated >= 19);
    CHECK(after.forwarded - before.forwarded <= 1);
    end();
}

static void a_board_plugged_in_while_streaming_is_detected(void)
{
    begin(1);
    fake.hub.cycle.period_us = UPKEEP_US;
    fake_sensor_init(&sensors[1], 0x55, 2, 2, 0);
    CHECK_EQUAL(fake_sensor_boot(&sensors[1]), 0);
    fake_scan(&sensors[1], 1);
    (void)fake_hub_add(&fake, 0x55, &sensors[1]);
    CHECK(fake_hub_run_cycles(&fake, 30)); /* 112 addresses at 4 per cycle, and one cycle for the identification */
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, 0x55) > 0);
    fake_sensor_init(&sensors[2], 0x08, 2, 2, 0); /* before all other addresses */
    CHECK_EQUAL(fake_sensor_boot(&sensors[2]), 0);
    fake_scan(&sensors[2], 1);
    (void)fake_hub_add(&fake, 0x08, &sensors[2]);
    CHECK(fake_hub_run_cycles(&fake, 30));
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, 0x08) > 0);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST)->forwarded, taxel_hub_polls(fake_hub_slot(&fake, FIRST)));
    end();
}

static void boards_beyond_the_slots_are_not_polled(void)
{
    begin(FAKE_SLOTS + 4u);
    CHECK_EQUAL(fake.hub.slot_count, FAKE_SLOTS);
    CHECK(fake_hub_run_cycles(&fake, 20));
    CHECK_EQUAL(fake.slots[FAKE_SLOTS - 1].forwarded, 20);
    end();
}

static void a_hub_without_boards_probes_every_20_ms(void)
{
    begin(0);
    const uint64_t transfers = fake.transfers;
    fake_hub_run(&fake, 1000000);
    CHECK_BETWEEN(fake.transfers - transfers, 4 * 40, 4 * 52); /* 4 probes every 20 ms, not continuously */
    end();
}

/* Send the command SET_RATE with the shortest time between two poll cycles. */
static void set_period(uint32_t microseconds)
{
    uint8_t period[4];
    taxel_put_u32(period, microseconds);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_SET_RATE, period, sizeof period), 0);
    fake_hub_forget_frames(&fake);
}

static void the_hub_keeps_a_selected_rate_of_100_hz(void)
{
    begin(3);
    set_period(10000);
    CHECK(fake_hub_run_cycles(&fake, 2));
    const uint32_t cycles = fake.hub.cycle.count;
    fake_hub_run(&fake, 1000000);
    CHECK_BETWEEN(fake.hub.cycle.count - cycles, 99, 101);
    end();
}

/* Check that status frames arrive once per second if poll cycles have this period. */
static void check_status_once_per_second(uint32_t period_us)
{
    begin(3);
    set_period(period_us);
    fake_hub_run(&fake, 8500000);
    CHECK_BETWEEN(fake_hub_count(&fake, TAXEL_FRAME_TYPE_HUB_STATUS), 8, 9);
    CHECK_BETWEEN(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_BOARD_STATUS, FIRST + 2), 8, 9);
    end();
}

static void the_status_is_sent_once_per_second(void)
{
    check_status_once_per_second(20000);
}

static void the_status_is_sent_once_per_second_at_a_slow_rate(void)
{
    check_status_once_per_second(4000000);
}

static void cycle_numbers_and_clocks_wrap(void)
{
    begin(2);
    fake.hub.cycle.number = 0xFFFE;
    fake.now_us = 0xFFFFF000u; /* hub and boards pass 2^32 us */
    fake.wake_us = 0;
    CHECK(fake_hub_run_cycles(&fake, 8));
    fake_hub_forget_frames(&fake);
    const uint32_t polls = taxel_hub_polls(fake_hub_slot(&fake, FIRST)),
                   forwarded = fake_hub_slot(&fake, FIRST)->forwarded;
    fake.hub.cycle.number = 0xFFF0;
    CHECK(fake_hub_run_cycles(&fake, 40));
    CHECK(fake.now_us > 0x100000000u);
    CHECK_EQUAL(taxel_hub_polls(fake_hub_slot(&fake, FIRST)) - polls, 40);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST)->forwarded - forwarded, 40);
    CHECK_EQUAL(fake.hub.cycle.number, 0xFFF0 + 40 - 0x10000);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_RESTARTED), 0);
    end();
}

int main(void)
{
    RUN(a_handshake_frame_announces_the_start);
    RUN(boards_are_detected_and_identified_before_streaming);
    RUN(every_cycle_polls_every_board_in_the_order_of_addresses);
    RUN(a_poll_writes_the_pointer_only_if_it_was_moved);
    RUN(a_cycle_of_50_ms_reads_one_boards_clock);
    RUN(a_board_without_a_newer_scan_is_counted_as_repeated);
    RUN(a_board_plugged_in_while_streaming_is_detected);
    RUN(boards_beyond_the_slots_are_not_polled);
    RUN(a_hub_without_boards_probes_every_20_ms);
    RUN(the_hub_keeps_a_selected_rate_of_100_hz);
    RUN(the_status_is_sent_once_per_second);
    RUN(the_status_is_sent_once_per_second_at_a_slow_rate);
    RUN(cycle_numbers_and_clocks_wrap);
    return check_summary();
}
