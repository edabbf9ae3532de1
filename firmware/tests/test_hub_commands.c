/* Every command of the host, with valid and invalid arguments, streaming and not streaming. */
#include "check.h"
#include "codec/crc32.h"
#include "fake_hub.h"

#define FIRST 0x20

static struct fake_hub fake;
static struct fake_sensor sensors[4];

/* Start a hub with three boards. `streaming`: the hub streams, otherwise it is idle. */
static void begin(bool streaming)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, 3);
    CHECK(fake_hub_start(&fake));
    if (!streaming) {
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_STOP, NULL, 0), 0);
        fake_hub_run(&fake, 50000);
        fake_hub_forget_frames(&fake);
    }
}

/* Check that counters balance and no frame is missing, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    fake_hub_free_boards(&fake);
}

/* Send a command to the hub and wait for its reply. Returns the status of the reply. */
static int command(uint8_t code, const void *arguments, size_t size)
{
    return fake_hub_command(&fake, code, arguments, size);
}

static void commands_are_rejected_before_the_handshake(void)
{
    fake_hub_init(&fake);
    fake_hub_boot(&fake);
    for (unsigned code = 0; code < 256; code++) {
        CHECK_EQUAL(command((uint8_t)code, NULL, 0), TAXEL_REPLY_STATUS_NO_HANDSHAKE);
    }
    CHECK(!fake.hub.streaming);
    CHECK_EQUAL(fake.hub.inbox.commands_rejected, 256);
    end();
}

static void the_handshake_chooses_the_highest_common_version(void)
{
    static const uint8_t cases[][3] = {{1, 1, 1}, {1, 255, 3}, {0, 1, 1}, {1, 2, 2}, {2, 9, 3},
                                       {3, 9, 3}, {4, 9, 0},   {0, 0, 0}, {2, 1, 0}};
    fake_hub_init(&fake);
    fake_hub_boot(&fake);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const uint8_t handshake[3] = {(uint8_t)(100 + i), cases[i][0], cases[i][1]};
        fake_hub_send(&fake, TAXEL_FRAME_TYPE_HOST_HANDSHAKE, handshake, sizeof handshake);
        fake_hub_run(&fake, 1000);
        const struct fake_frame *answer = fake_hub_last(&fake, TAXEL_FRAME_TYPE_HUB_HANDSHAKE);
        CHECK_EQUAL(answer->payload[0], 100 + i);
        CHECK_EQUAL(answer->payload[TAXEL_HUB_HANDSHAKE_OFFSET_VERSION_CHOSEN], cases[i][2]);
        CHECK_EQUAL(command(TAXEL_COMMAND_GET_TIME, NULL, 0), cases[i][2] ? 0 : TAXEL_REPLY_STATUS_NO_HANDSHAKE);
    }
    end();
}

static void wrong_lengths_and_unknown_commands_are_rejected(void)
{
    static const struct {
        uint8_t code, minimum, maximum;
    } rules[] = {{TAXEL_COMMAND_START, 0, 1},
                 {TAXEL_COMMAND_STOP, 0, 0},
                 {TAXEL_COMMAND_SET_RATE, 4, 4},
                 {TAXEL_COMMAND_SCAN_BUS, 0, 0},
                 {TAXEL_COMMAND_I2C_TRANSFER, 2, 66},
                 {TAXEL_COMMAND_SET_SCAN_SETTINGS, 9, 10},
                 {TAXEL_COMMAND_REBOOT, 0, 0},
                 {TAXEL_COMMAND_GET_STATUS, 0, 0},
                 {TAXEL_COMMAND_GET_BOARD_INFO, 1, 1},
                 {TAXEL_COMMAND_GET_TIME, 0, 0},
                 {TAXEL_COMMAND_ENTER_BOOTLOADER, 4, 4},
                 {TAXEL_COMMAND_GET_FAULT, 0, 0}};
    const uint8_t zeros[66] = {0};
    begin(false);
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        for (size_t size = 0; size <= sizeof zeros; size++) {
            if (size < rules[i].minimum || size > rules[i].maximum) {
                CHECK_EQUAL(command(rules[i].code, zeros, size), TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
            }
        }
    }
    CHECK_EQUAL(command(0, NULL, 0), TAXEL_REPLY_STATUS_UNKNOWN_COMMAND);
    for (unsigned code = TAXEL_COMMAND_GET_FAULT + 1; code < 256; code++) {
        CHECK_EQUAL(command((uint8_t)code, zeros, 3), TAXEL_REPLY_STATUS_UNKNOWN_COMMAND);
    }
    CHECK_EQUAL(fake.restarts, 0);
    CHECK(!fake.hub.streaming);
    end();
}

static void stop_ends_and_start_resumes_the_stream(void)
{
    begin(true);
    fake_hub_run(&fake, 10000);
    CHECK_EQUAL(command(TAXEL_COMMAND_STOP, NULL, 0), 0);
    fake_hub_run(&fake, 5000);
    fake_hub_forget_frames(&fake);
    fake_hub_run(&fake, 200000);
    CHECK_EQUAL(fake.frame_count, 0);
    CHECK_EQUAL(command(TAXEL_COMMAND_START, NULL, 0), 0);
    CHECK(fake_hub_run_cycles(&fake, 3));
    CHECK_EQUAL(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST), 3);
    CHECK_EQUAL(command(TAXEL_COMMAND_START, NULL, 0), 0); /* no effect on the numbering */
    CHECK(fake.hub.cycle.number >= 3);
    end();
}

/* STOP and START arrive after any number of transfers: the first cycle still polls every board. */
static void a_start_at_any_time_polls_every_board_in_its_first_cycle(void)
{
    for (uint64_t after = 0; after < 30; after++) {
        begin(true);
        fake.devices[0].unplugged = fake.devices[1].unplugged = true;
        CHECK(fake_hub_run_cycles(&fake, 5));
        fake.devices[0].unplugged = fake.devices[1].unplugged = false;
        const uint64_t until = fake.transfers + after;
        while (fake.transfers < until && fake_hub_step(&fake, FAKE_NEVER)) {
        }
        const uint8_t stop[2] = {1, TAXEL_COMMAND_STOP}, start[2] = {2, TAXEL_COMMAND_START};
        fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, stop, sizeof stop);
        fake_hub_forget_frames(&fake);
        fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, start, sizeof start);
        CHECK(fake_hub_run_cycles(&fake, 1));
        for (uint8_t i = 0; i < 3; i++) {
            CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, (uint8_t)(FIRST + i)) >= 1);
        }
        end();
    }
}

static void a_pass_through_reads_and_writes_registers_of_a_board(void)
{
    for (unsigned streaming = 0; streaming < 2; streaming++) {
        uint8_t arguments[2 + TAXEL_TRANSFER_MAX] = {FIRST + 1, TAXEL_IDENTITY_SIZE, TAXEL_REGISTER_IDENTITY};
        uint8_t identity[TAXEL_IDENTITY_SIZE];
        begin(streaming);
        CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), 0);
        CHECK_EQUAL(fake.reply_size, TAXEL_IDENTITY_SIZE);
        CHECK(fake_read_at(&sensors[1], 0, identity, sizeof identity));
        CHECK_BYTES(fake.reply, identity, sizeof identity);
        arguments[1] = 0;
        CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 2), 0); /* nothing to write or read: a probe */
        CHECK_EQUAL(fake.reply_size, 0);
        memcpy(arguments + 2, (const uint8_t[]){TAXEL_REGISTER_COMMAND, 2, 0xFD}, 3);
        CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 5), 0);
        CHECK_EQUAL(sensors[1].sensor.state, TAXEL_SENSOR_STOPPED);
        arguments[0] = 0x60;
        CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_NACK);
        arguments[0] = FIRST + 1;
        CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, sizeof arguments), TAXEL_REPLY_STATUS_NACK);
        CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->crc_errors, 0);
        end();
    }
}

/* The transfer of the host has moved the register pointer of the board: the next poll writes the pointer again. */
static void a_pass_through_causes_no_retry_of_a_poll(void)
{
    const uint8_t arguments[3] = {FIRST + 1, TAXEL_IDENTITY_SIZE, TAXEL_REGISTER_IDENTITY};
    begin(true);
    CHECK(fake_hub_run_cycles(&fake, 3));
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, sizeof arguments), 0);
    CHECK(fake_hub_run_cycles(&fake, 3));
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->retries, 0);
    end();
}

/* While the hub does not stream, it scans the bus and identifies boards. While the host makes transfers, the hub makes
 * none itself. */
static void the_idle_bus_is_reserved_for_the_host_during_its_transfers(void)
{
    const uint8_t arguments[3] = {FIRST, 4, TAXEL_REGISTER_CLOCK};
    begin(false);
    fake.devices[1].unplugged = true;
    fake_hub_run(&fake, 100000);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->state, TAXEL_BOARD_STATE_ABSENT);
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, sizeof arguments), 0);
    fake_hub_run(&fake, 5000); /* a bus scan in progress ends */
    fake.devices[1].unplugged = false;
    const uint64_t before = fake.transfers;
    for (unsigned i = 0; i < 20; i++) {
        CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, sizeof arguments), 0);
        fake_hub_run(&fake, 50000);
    }
    CHECK_EQUAL(fake.transfers - before, 20);
    CHECK_EQUAL(command(TAXEL_COMMAND_SCAN_BUS, NULL, 0), 0); /* a commanded bus scan is made */
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->state, TAXEL_BOARD_STATE_IDENTIFYING);
    fake_hub_run(&fake, 110000);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->state, TAXEL_BOARD_STATE_STREAMING);
    end();
}

/* Commands that need transfers of the hub do not wait until the host's reservation of the bus has ended. */
static void board_commands_are_executed_between_the_hosts_transfers(void)
{
    const uint8_t arguments[3] = {FIRST, 4, TAXEL_REGISTER_CLOCK};
    const uint8_t all = 0;
    begin(false);
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, sizeof arguments), 0);
    CHECK_EQUAL(fake_hub_command_within(&fake, TAXEL_COMMAND_GET_BOARD_INFO, &all, 1, 20000), 0);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), 3);
    end();
}

static void a_pass_through_with_invalid_arguments_is_rejected(void)
{
    uint8_t arguments[3] = {0x07, 1, 0};
    begin(true);
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
    arguments[0] = 0x78;
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
    arguments[0] = FIRST;
    arguments[1] = TAXEL_TRANSFER_MAX + 1;
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
    end();
}

/* End transfers that read 3 bytes with the result that the test has selected; script of the bus. */
static int end_pass_through(struct fake_hub *hub, const struct taxel_i2c_transfer *transfer)
{
    return transfer->read_size == 3 ? hub->script_state : FAKE_PROCEED;
}

static void a_failed_pass_through_reports_the_cause(void)
{
    const uint8_t arguments[3] = {FIRST, 3, 0};
    begin(true);
    fake.script = end_pass_through;
    fake.script_state = FAKE_HANG;
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_TIMEOUT);
    fake.script_state = TAXEL_I2C_NACK_DATA;
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_NACK);
    fake.script_state = TAXEL_I2C_BUS_ERROR;
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_BUS_ERROR);
    fake.script_state = TAXEL_I2C_ARBITRATION_LOST;
    CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, 3), TAXEL_REPLY_STATUS_BUS_ERROR);
    end();
}

/* A transfer of 64 bytes on a slow bus takes longer than the time limit of a short transfer. */
static void the_longest_pass_through_does_not_time_out_on_a_slow_bus(void)
{
    const uint8_t arguments[2 + TAXEL_TRANSFER_MAX] = {0x60, 0, 1, 2, 3};
    for (uint32_t scl_hz = 10000; scl_hz <= 400000; scl_hz *= 2) {
        fake_hub_init(&fake);
        fake.config.scl_hz = scl_hz;
        fake_hub_add(&fake, 0x60, NULL)->foreign = 0x11;
        fake_hub_boot(&fake);
        fake_hub_run(&fake, 500000);
        CHECK(fake_hub_handshake(&fake));
        CHECK_EQUAL(command(TAXEL_COMMAND_I2C_TRANSFER, arguments, sizeof arguments), 0);
        end();
    }
}

static void scan_bus_lists_the_addresses_that_acknowledge(void)
{
    for (unsigned streaming = 0; streaming < 2; streaming++) {
        const uint8_t expected[] = {FIRST, FIRST + 2, 0x77};
        begin(streaming);
        (void)fake_hub_add(&fake, 0x77, NULL);
        fake.devices[1].unplugged = true;
        CHECK_EQUAL(command(TAXEL_COMMAND_SCAN_BUS, NULL, 0), 0);
        CHECK_EQUAL(fake.reply_size, sizeof expected);
        CHECK_BYTES(fake.reply, expected, sizeof expected);
        end();
    }
}

/* SCAN_BUS detects a board between any two others, after any transfer of a cycle: each other board is polled exactly
 * once. */
static void a_board_detected_during_a_cycle_changes_no_other_poll(void)
{
    for (unsigned repetition = 0; repetition < 3 * 10; repetition++) {
        const uint8_t scan_bus[2] = {1, TAXEL_COMMAND_SCAN_BUS};
        /* not the first board, whose poll starts in the pass that ends a cycle */
        const size_t new_board = 1 + repetition % 3;
        uint32_t polls[4] = {0};
        fake_hub_init(&fake);
        fake_hub_add_boards(&fake, sensors, FIRST, 4);
        fake.devices[new_board].unplugged = true;
        CHECK(fake_hub_start(&fake));
        CHECK(fake_hub_run_cycles(&fake, 3));
        for (size_t i = 0; i < 4; i++) {
            polls[i] = i == new_board ? 0 : taxel_hub_polls(fake_hub_slot(&fake, (uint8_t)(FIRST + i)));
        }
        const uint32_t cycles = fake.hub.cycle.count;
        const uint64_t until = fake.transfers + repetition / 3;
        while (fake.transfers < until && fake_hub_step(&fake, FAKE_NEVER)) {
        }
        fake.devices[new_board].unplugged = false;
        fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, scan_bus, sizeof scan_bus);
        CHECK(fake_hub_run_cycles(&fake, 3));
        CHECK(fake_hub_slot(&fake, (uint8_t)(FIRST + new_board)) != NULL);
        for (size_t i = 0; i < 4; i++) {
            if (i != new_board) {
                CHECK_EQUAL(taxel_hub_polls(fake_hub_slot(&fake, (uint8_t)(FIRST + i))) - polls[i],
                            fake.hub.cycle.count - cycles);
            }
        }
        end();
    }
}

static void get_time_and_get_status_report_time_and_counters(void)
{
    begin(true);
    CHECK_EQUAL(command(TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    CHECK_EQUAL(fake.reply_size, 8);
    CHECK_BETWEEN((double)(fake.now_us - taxel_get_u64(fake.reply)), 0, 100);
    fake_hub_run(&fake, 50000);
    fake_hub_forget_frames(&fake);
    CHECK_EQUAL(command(TAXEL_COMMAND_GET_STATUS, NULL, 0), 0);
    struct taxel_hub_status status;
    struct taxel_board_status board;
    taxel_hub_status_unpack(&status, fake_hub_last(&fake, TAXEL_FRAME_TYPE_HUB_STATUS)->payload);
    CHECK_EQUAL(status.boards_streaming, 3);
    CHECK_EQUAL(status.streaming, 1);
    CHECK_EQUAL(status.commands, 3); /* START, GET_TIME and this one */
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_STATUS), 3);
    taxel_board_status_unpack(&board, fake_hub_last(&fake, TAXEL_FRAME_TYPE_BOARD_STATUS)->payload);
    CHECK_EQUAL(board.address, FIRST + 2);
    CHECK_EQUAL(board.state, TAXEL_BOARD_STATE_STREAMING);
    CHECK(board.polls > 5);
    CHECK_BETWEEN(board.polls - board.forwarded, 0, 1);
    end();
}

static void get_fault_replies_with_the_record_of_the_port(void)
{
    static const uint8_t record[TAXEL_FAULT_RECORD_SIZE] = {
        TAXEL_FAULT_CODE_EXCEPTION, 3, 1, 0, 0x2C, 0x1A, 0, 0, 0x47, 0x1B, 0, 0};
    begin(false);
    CHECK_EQUAL(command(TAXEL_COMMAND_GET_FAULT, NULL, 0), 0);
    CHECK_EQUAL(fake.reply_size, 0);
    fake.config.fault_record = record;
    CHECK_EQUAL(command(TAXEL_COMMAND_GET_FAULT, NULL, 0), 0);
    CHECK_EQUAL(fake.reply_size, sizeof record);
    CHECK_BYTES(fake.reply, record, sizeof record);
    fake.config.fault_record = NULL;
    end();
}

int main(void)
{
    RUN(commands_are_rejected_before_the_handshake);
    RUN(the_handshake_chooses_the_highest_common_version);
    RUN(get_fault_replies_with_the_record_of_the_port);
    RUN(wrong_lengths_and_unknown_commands_are_rejected);
    RUN(stop_ends_and_start_resumes_the_stream);
    RUN(a_start_at_any_time_polls_every_board_in_its_first_cycle);
    RUN(a_pass_through_reads_and_writes_registers_of_a_board);
    RUN(a_pass_through_causes_no_retry_of_a_poll);
    RUN(the_idle_bus_is_reserved_for_the_host_during_its_transfers);
    RUN(board_commands_are_executed_between_the_hosts_transfers);
    RUN(a_pass_through_with_invalid_arguments_is_rejected);
    RUN(a_failed_pass_through_reports_the_cause);
    RUN(the_longest_pass_through_does_not_time_out_on_a_slow_bus);
    RUN(scan_bus_lists_the_addresses_that_acknowledge);
    RUN(a_board_detected_during_a_cycle_changes_no_other_poll);
    RUN(get_time_and_get_status_report_time_and_counters);
    return check_summary();
}
