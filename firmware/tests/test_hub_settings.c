/* Scan settings and board information through the hub: one board, all boards, unknown, rejecting and unplugged
 * boards. */
#include "check.h"
#include "fake_hub.h"

#define FIRST 0x20

static struct fake_hub fake;
static struct fake_sensor sensors[4];
static const struct taxel_scan_settings good = {80, 40, 1, 12, 96};
static const struct taxel_scan_settings bad = {0, 40, 1, 12, 96};

/* Start a hub with three boards. `streaming`: the hub streams, otherwise it is idle. */
static void begin(bool streaming)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, 3);
    CHECK(fake_hub_start(&fake));
    if (!streaming) {
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_STOP, NULL, 0), 0);
        fake_hub_run(&fake, 50000);
    }
    fake_hub_forget_frames(&fake);
}

/* Check that counters balance and no frame is missing, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    fake_hub_free_boards(&fake);
}

/* Send the command SET_SCAN_SETTINGS for one board (0: all). Returns the status of the reply. */
static int set_settings(uint8_t address, const struct taxel_scan_settings *settings)
{
    uint8_t arguments[TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE] = {address};
    taxel_scan_settings_pack(settings, arguments + 1);
    return fake_hub_command(&fake, TAXEL_COMMAND_SET_SCAN_SETTINGS, arguments, sizeof arguments);
}

#define OTHER_FRONT_END 0x81u
static const struct taxel_scan_settings for_other_front_end = {0, 0, 0, 0, 7};

/* Accept all settings, as a converter whose limits differ from those of CapSense; HAL function of a board. */
static bool accept_all(void *context, const struct taxel_scan_settings *settings)
{
    (void)context;
    (void)settings;
    return true;
}

/* Send SET_SCAN_SETTINGS for the second board with a front end, or without one if it is 0. Returns the status. */
static int set_settings_for(uint8_t front_end, const struct taxel_scan_settings *settings)
{
    uint8_t arguments[TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE] = {FIRST + 1};
    taxel_scan_settings_pack(settings, arguments + 1);
    arguments[TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_FRONT_END] = front_end;
    return fake_hub_command(&fake, TAXEL_COMMAND_SET_SCAN_SETTINGS, arguments, sizeof arguments - !front_end);
}

/* Give the second board another converter. */
static void exchange_front_end(void)
{
    sensors[1].config.front_end = OTHER_FRONT_END;
    sensors[1].hal.front_end_accepts = accept_all;
}

static void settings_reach_only_boards_with_their_front_end(void)
{
    begin(true);
    CHECK_EQUAL(set_settings_for(OTHER_FRONT_END, &good), TAXEL_REPLY_STATUS_REJECTED_BY_BOARD);
    CHECK_EQUAL(set_settings_for(0, &good), 0);
    exchange_front_end();
    CHECK_EQUAL(set_settings_for(0, &good), 0); /* the board already has these settings, which the hub reads back */
    CHECK_EQUAL(set_settings_for(0, &for_other_front_end), TAXEL_REPLY_STATUS_REJECTED_BY_BOARD);
    CHECK_EQUAL(set_settings_for(0x82, &for_other_front_end), TAXEL_REPLY_STATUS_REJECTED_BY_BOARD);
    CHECK_EQUAL(set_settings_for(OTHER_FRONT_END, &for_other_front_end), 0);
    fake_scan(&sensors[1], 1);
    CHECK_EQUAL(sensors[1].front_end.settle_cycles, 7);
    CHECK_EQUAL(fake_status(&sensors[1]).front_end, OTHER_FRONT_END);
    end();
}

static void settings_of_another_front_end_are_written_again_after_a_restart(void)
{
    begin(true);
    exchange_front_end();
    CHECK_EQUAL(set_settings_for(OTHER_FRONT_END, &for_other_front_end), 0);
    fake.devices[1].unplugged = true;
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake_sensor_boot(&sensors[1]), 0);
    fake.devices[1].unplugged = false;
    CHECK(fake_hub_run_cycles(&fake, 10));
    fake_scan(&sensors[1], 1);
    CHECK_EQUAL(sensors[1].front_end.settle_cycles, 7);
    end();
}

/* Send the command GET_BOARD_INFO for one board (0: all). Returns the status of the reply. */
static int get_board_info(uint8_t address)
{
    return fake_hub_command(&fake, TAXEL_COMMAND_GET_BOARD_INFO, &address, 1);
}

/* Return the number of sub-conversions of a board's next scan, by which the tests identify its scan settings. */
static uint16_t scanned_sub_conversions(size_t board)
{
    fake_scan(&sensors[board], 1);
    return sensors[board].front_end.sub_conversions;
}

static void settings_are_written_to_one_board(void)
{
    for (unsigned streaming = 0; streaming < 2; streaming++) {
        begin(streaming);
        CHECK_EQUAL(set_settings(FIRST + 1, &good), 0);
        CHECK_EQUAL(scanned_sub_conversions(0), 160);
        CHECK_EQUAL(scanned_sub_conversions(1), 80);
        CHECK_EQUAL(scanned_sub_conversions(2), 160);
        end();
    }
}

static void settings_are_written_to_all_boards(void)
{
    for (unsigned streaming = 0; streaming < 2; streaming++) {
        begin(streaming);
        CHECK_EQUAL(set_settings(0, &good), 0);
        for (size_t i = 0; i < 3; i++) {
            CHECK_EQUAL(scanned_sub_conversions(i), 80);
        }
        CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_FAULT), 0);
        end();
    }
}

static void settings_for_an_unknown_board_are_rejected(void)
{
    begin(true);
    CHECK_EQUAL(set_settings(0x60, &good), TAXEL_REPLY_STATUS_UNKNOWN_BOARD);
    CHECK_EQUAL(get_board_info(0x60), TAXEL_REPLY_STATUS_UNKNOWN_BOARD);
    end();
}

static void settings_that_the_board_rejects_are_reported(void)
{
    for (unsigned streaming = 0; streaming < 2; streaming++) {
        begin(streaming);
        CHECK_EQUAL(set_settings(FIRST + 1, &bad), TAXEL_REPLY_STATUS_REJECTED_BY_BOARD);
        CHECK_EQUAL(scanned_sub_conversions(1), 160);
        CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_SETTINGS_REJECTED), 1);
        CHECK_EQUAL(set_settings(FIRST + 1, &good), 0);
        CHECK_EQUAL(scanned_sub_conversions(1), 80);
        end();
    }
}

static void an_earlier_rejection_does_not_affect_a_later_command(void)
{
    begin(true);
    CHECK_EQUAL(set_settings(FIRST + 1, &bad), TAXEL_REPLY_STATUS_REJECTED_BY_BOARD);
    fake.devices[1].unplugged = true;
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(set_settings(0, &good), 0);
    CHECK_EQUAL(scanned_sub_conversions(0), 80);
    end();
}

static void rejected_settings_are_not_written_again_after_a_restart(void)
{
    begin(true);
    CHECK_EQUAL(set_settings(FIRST + 1, &bad), TAXEL_REPLY_STATUS_REJECTED_BY_BOARD);
    fake.devices[1].unplugged = true;
    CHECK(fake_hub_run_cycles(&fake, 10));
    fake.devices[1].unplugged = false;
    fake_hub_forget_frames(&fake);
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_SETTINGS_REJECTED), 0);
    end();
}

/* Lose the next writes of settings to the second board: they are not acknowledged; script of the bus. */
static int lose_settings_write(struct fake_hub *hub, const struct taxel_i2c_transfer *transfer)
{
    if (transfer->address == FIRST + 1 && transfer->write_size == 1u + TAXEL_SETTINGS_REGISTER_SIZE &&
        hub->script_state) {
        hub->script_state--;
        return TAXEL_I2C_NACK_ADDRESS;
    }
    return FAKE_PROCEED;
}

static void a_lost_write_of_settings_is_reported(void)
{
    begin(true);
    fake.script = lose_settings_write;
    fake.script_state = 1;
    const int status = set_settings(FIRST + 1, &good);
    CHECK(status == 0 ? scanned_sub_conversions(1) == 80 : scanned_sub_conversions(1) == 160);
    end();
}

static void a_board_that_is_unplugged_during_the_write_ends_the_command(void)
{
    begin(true);
    fake.script = lose_settings_write;
    fake.script_state = 1000;
    fake.devices[1].nacks = 1000;
    CHECK(set_settings(0, &good) > 0);
    CHECK_EQUAL(scanned_sub_conversions(0), 80);
    CHECK_EQUAL(scanned_sub_conversions(2), 80);
    end();
}

static void board_info_is_sent_for_one_board_or_all(void)
{
    for (unsigned streaming = 0; streaming < 2; streaming++) {
        begin(streaming);
        CHECK_EQUAL(get_board_info(FIRST + 2), 0);
        CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), 1);
        const struct fake_frame *info = fake_hub_last(&fake, TAXEL_FRAME_TYPE_BOARD_INFO);
        CHECK_EQUAL(info->payload[TAXEL_IDENTITY_OFFSET_ADDRESS], FIRST + 2);
        CHECK_EQUAL(taxel_get_u16(info->payload + TAXEL_IDENTITY_SIZE), 160);
        CHECK_EQUAL(get_board_info(0), 0);
        CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), 4);
        end();
    }
}

static void board_info_reports_the_settings_in_force(void)
{
    begin(true);
    CHECK_EQUAL(set_settings(FIRST, &good), 0);
    CHECK_EQUAL(get_board_info(FIRST), 0);
    const struct fake_frame *info = fake_hub_last(&fake, TAXEL_FRAME_TYPE_BOARD_INFO);
    CHECK_EQUAL(taxel_get_u16(info->payload + TAXEL_IDENTITY_SIZE), 80);
    end();
}

/* At one cycle per minute the hub still answers commands, also one that increases the rate. */
static void commands_do_not_wait_for_a_slow_cycle(void)
{
    uint8_t period[4];
    begin(true);
    taxel_put_u32(period, 60000000);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_SET_RATE, period, sizeof period), 0);
    fake_hub_run(&fake, 20000);
    CHECK_EQUAL(get_board_info(FIRST), 0);
    CHECK_EQUAL(set_settings(0, &good), 0);
    CHECK_EQUAL(scanned_sub_conversions(2), 80);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_STATUS, NULL, 0), 0);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_SCAN_BUS, NULL, 0), 0);
    taxel_put_u32(period, 0);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_SET_RATE, period, sizeof period), 0);
    fake_hub_forget_frames(&fake);
    fake_hub_run(&fake, 20000);
    CHECK(fake_hub_count(&fake, TAXEL_FRAME_TYPE_TAXELS) > 5);
    end();
}

int main(void)
{
    RUN(settings_are_written_to_one_board);
    RUN(settings_are_written_to_all_boards);
    RUN(settings_for_an_unknown_board_are_rejected);
    RUN(settings_that_the_board_rejects_are_reported);
    RUN(settings_reach_only_boards_with_their_front_end);
    RUN(settings_of_another_front_end_are_written_again_after_a_restart);
    RUN(an_earlier_rejection_does_not_affect_a_later_command);
    RUN(rejected_settings_are_not_written_again_after_a_restart);
    RUN(a_lost_write_of_settings_is_reported);
    RUN(a_board_that_is_unplugged_during_the_write_ends_the_command);
    RUN(board_info_is_sent_for_one_board_or_all);
    RUN(board_info_reports_the_settings_in_force);
    RUN(commands_do_not_wait_for_a_slow_cycle);
    return check_summary();
}
