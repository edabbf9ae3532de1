/* Restarts of boards and hub: only real restarts of a board are detected, and its settings are written again. */
#include "check.h"
#include "fake_hub.h"

#define FIRST 0x20

static struct fake_hub fake;
static struct fake_sensor sensors[4];

/* Start a hub that streams from this number of boards, and run three poll cycles. */
static void begin(size_t boards)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, boards);
    CHECK(fake_hub_start(&fake));
    CHECK(fake_hub_run_cycles(&fake, 3));
    fake_hub_forget_frames(&fake);
}

/* Check that counters balance and no frame is missing, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    fake_hub_free_boards(&fake);
}

/* Restart a board between two polls: its clock begins at zero. */
static void restart_board(size_t board)
{
    CHECK_EQUAL(fake_sensor_boot(&sensors[board]), 0);
    fake.devices[board].clock_offset_us = 0u - (uint32_t)fake.now_us;
    sensors[board].clock_us = 0;
    fake_scan(&sensors[board], 1);
}

static void a_restarted_board_is_reported_and_identified_again(void)
{
    begin(3);
    restart_board(1);
    CHECK(fake_hub_run_cycles(&fake, 4));
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_RESTARTED), 1);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), 1);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->state, TAXEL_BOARD_STATE_STREAMING);
    CHECK_EQUAL(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST + 1), 4);
    end();
}

static void a_restarted_board_gets_its_settings_again(void)
{
    uint8_t arguments[TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE] = {FIRST + 1};
    const struct taxel_scan_settings settings = {80, 40, 1, 12, 96};
    begin(2);
    taxel_scan_settings_pack(&settings, arguments + 1);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_SET_SCAN_SETTINGS, arguments, sizeof arguments), 0);
    CHECK(fake_hub_run_cycles(&fake, 2));
    CHECK_EQUAL(sensors[1].front_end.sub_conversions, 80);
    restart_board(1);
    CHECK_EQUAL(sensors[1].front_end.sub_conversions, 160);
    CHECK(fake_hub_run_cycles(&fake, 6));
    CHECK_EQUAL(sensors[1].front_end.sub_conversions, 80);
    CHECK_EQUAL(sensors[0].front_end.sub_conversions, 160);
    end();
}

static void after_a_pause_of_two_minutes_no_board_is_reported_as_restarted(void)
{
    begin(2);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_STOP, NULL, 0), 0);
    for (unsigned i = 0; i < 120; i++) {
        fake.now_us += 1000000u; /* a jump in time skips the bus scans of the idle hub */
        fake_hub_run(&fake, 1000);
        for (size_t board = 0; board < 2; board++) {
            sensors[board].clock_us = (uint32_t)fake.now_us - 1000u; /* the following scans end at the present time */
            fake_scan(&sensors[board], 2);                           /* the boards continue to scan */
        }
    }
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_START, NULL, 0), 0);
    fake_hub_forget_frames(&fake);
    CHECK(fake_hub_run_cycles(&fake, 5));
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_RESTARTED), 0);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), 0);
    CHECK_EQUAL(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST), 5);
    end();
}

/* Check all BOARD_INFO frames: the identity begins with WHO_AM_I and has a valid CRC. */
static void check_board_infos(void)
{
    for (size_t i = 0; i < fake.frame_count; i++) {
        if (fake.frames[i].type == TAXEL_FRAME_TYPE_BOARD_INFO) {
            const uint8_t *identity = fake.frames[i].payload;
            CHECK_EQUAL(identity[0], TAXEL_WHO_AM_I);
            CHECK_EQUAL(identity[TAXEL_IDENTITY_OFFSET_ADDRESS] & 0xFEu, FIRST);
        }
    }
}

/* While the hub writes the settings again, a command may arrive between any two transfers. */
static void board_info_is_valid_at_any_time(void)
{
    uint8_t arguments[TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE] = {0};
    const struct taxel_scan_settings settings = {80, 40, 1, 12, 96};
    const uint8_t all[1] = {0};
    for (uint64_t after = 0; after < 40; after++) {
        begin(2);
        taxel_scan_settings_pack(&settings, arguments + 1);
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_SET_SCAN_SETTINGS, arguments, sizeof arguments), 0);
        restart_board(1);
        const uint64_t until = fake.transfers + after;
        while (fake.transfers < until && fake_hub_step(&fake, FAKE_NEVER)) {
        }
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_BOARD_INFO, all, sizeof all), 0);
        CHECK(fake_hub_run_cycles(&fake, 5));
        CHECK(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO) >= 2);
        CHECK_EQUAL(sensors[1].front_end.sub_conversions, 80);
        check_board_infos();
        end();
    }
}

static void a_reboot_waits_until_its_reply_is_sent(void)
{
    begin(2);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_REBOOT, NULL, 0), 0);
    fake_hub_run(&fake, 20000);
    CHECK(fake.restarts > 0);
    end();
}

static void the_bootloader_is_entered_only_with_the_key(void)
{
    static const uint8_t key[4] = {'B', 'O', 'O', 'T'}, other[4] = {'B', 'O', 'O', 'K'};
    begin(1);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_ENTER_BOOTLOADER, other, sizeof other),
                TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
    fake_hub_run(&fake, 20000);
    CHECK_EQUAL(fake.bootloader_entries, 0);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_ENTER_BOOTLOADER, key, sizeof key), TAXEL_REPLY_STATUS_OK);
    fake_hub_run(&fake, 20000);
    CHECK(fake.bootloader_entries > 0);
    CHECK_EQUAL(fake.restarts, 0);
    end();
}

static void a_hub_with_a_slow_uart_reboots(void)
{
    begin(4);
    fake.drain_bytes = 8; /* per pass of the main loop: much less than the hub sends */
    fake_hub_run(&fake, 200000);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_REBOOT, NULL, 0), 0);
    fake_hub_run(&fake, 2000000);
    CHECK(fake.restarts > 0);
    fake_hub_free_boards(&fake);
}

static void a_hub_with_a_stuck_uart_reboots(void)
{
    const uint8_t payload[2] = {9, TAXEL_COMMAND_REBOOT};
    begin(1);
    fake.drain_bytes = 0;
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, payload, sizeof payload);
    fake_hub_run(&fake, 2000000);
    CHECK(fake.restarts > 0);
    fake_hub_free_boards(&fake);
}

int main(void)
{
    RUN(a_restarted_board_is_reported_and_identified_again);
    RUN(a_restarted_board_gets_its_settings_again);
    RUN(after_a_pause_of_two_minutes_no_board_is_reported_as_restarted);
    RUN(board_info_is_valid_at_any_time);
    RUN(a_reboot_waits_until_its_reply_is_sent);
    RUN(the_bootloader_is_entered_only_with_the_key);
    RUN(a_hub_with_a_slow_uart_reboots);
    RUN(a_hub_with_a_stuck_uart_reboots);
    return check_summary();
}
