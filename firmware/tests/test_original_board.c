/* The firmware of an original board: read buffer, status word, and the counts, which are those of the scan that the
 * previous request started. */
#include "check.h"
#include "emulator/original/original_board.h"

#define ADDRESS 0x17u
#define TAXELS 6u
#define READ_SIZE (2u + 2u * TAXELS)
#define CONVERSION (333u * VTIME_US)
#define SCAN (TAXELS * CONVERSION)

static struct original_board board;
static bool has_accelerations;
static uint16_t next_count; /* raw count of the next conversion */

/* Execute all events up to `until`. The conversions of a board have the counts 100, 101, 102, ... */
static void advance(vtime until)
{
    while (original_board_next_event(&board) <= until) {
        if (original_board_is_converting(&board)) {
            original_board_on_conversion(&board, next_count++);
        } else {
            original_board_copy_word(&board);
        }
    }
}

/* Power up a board with the given known faults. The first scan measures 100 to 105. */
static void power_up_with(unsigned faults, double copy_us)
{
    struct original_settings settings;
    original_settings_set_defaults(&settings);
    settings.faults = faults;
    settings.copy_us = copy_us;
    settings.has_accelerations[ADDRESS] = has_accelerations;
    original_board_init(&board, ADDRESS, TAXELS, &settings);
    original_board_reset(&board, 0, CONVERSION);
    next_count = 100;
}

/* Power up a board without faults, whose copy takes 1 us per count. */
static void power_up(void)
{
    power_up_with(0, 1.0);
}

/* Write one byte to the board at virtual time `now`; the board must acknowledge it. */
static void write_byte(uint8_t byte, vtime now)
{
    advance(now);
    original_board_on_address(&board);
    CHECK(original_board_on_write(&board, byte));
    original_board_on_stop(&board, now);
}

/* Send the start command, as the general call of the hub does. */
static void send_start(vtime now)
{
    write_byte(ORIGINAL_START_COMMAND, now);
}

/* Read `size` bytes at virtual time `now`. Returns the status word. */
static uint16_t read_bytes(uint8_t *bytes, size_t size, vtime now)
{
    advance(now);
    original_board_on_address(&board);
    for (size_t i = 0; i < size; i++) {
        bytes[i] = original_board_on_read(&board);
    }
    original_board_on_stop(&board, now);
    return taxel_get_u16(bytes);
}

/* Return the raw count of taxel number `taxel` in the bytes read. */
static uint16_t count_at(const uint8_t *bytes, size_t taxel)
{
    return taxel_get_u16(bytes + 2u + 2u * taxel);
}

static void the_status_is_not_ready_before_the_first_command(void)
{
    uint8_t bytes[READ_SIZE];
    power_up();
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 10 * SCAN), ORIGINAL_STATUS_NOT_READY);
}

static void the_first_scan_starts_at_power_up(void)
{
    power_up();
    advance(10 * SCAN);
    CHECK_EQUAL(board.scans, 1);
}

static void a_command_returns_the_counts_of_the_previous_scan(void)
{
    uint8_t bytes[READ_SIZE];
    power_up();
    send_start(10 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 11 * SCAN), ORIGINAL_STATUS_READY);
    CHECK_EQUAL(count_at(bytes, 0), 100);
    CHECK_EQUAL(count_at(bytes, TAXELS - 1u), 105);
    send_start(20 * SCAN);
    (void)read_bytes(bytes, sizeof bytes, 21 * SCAN);
    CHECK_EQUAL(count_at(bytes, 0), 106); /* measured right after the first command */
}

static void status_and_counts_are_little_endian(void)
{
    const uint8_t expected[4] = {0xFE, 0xFF, 100, 0};
    uint8_t bytes[READ_SIZE];
    power_up();
    send_start(10 * SCAN);
    (void)read_bytes(bytes, sizeof bytes, 11 * SCAN);
    CHECK_BYTES(bytes, expected, sizeof expected);
}

static void the_same_counts_can_be_read_again_until_the_next_command(void)
{
    uint8_t first[READ_SIZE], second[READ_SIZE];
    power_up();
    send_start(10 * SCAN);
    (void)read_bytes(first, sizeof first, 11 * SCAN);
    CHECK_EQUAL(read_bytes(second, sizeof second, 12 * SCAN), ORIGINAL_STATUS_READY);
    CHECK_BYTES(second, first, sizeof first);
}

static void bytes_after_the_end_of_the_buffer_are_0xFF(void)
{
    uint8_t bytes[READ_SIZE + 3u];
    const uint8_t expected[3] = {0xFF, 0xFF, 0xFF};
    power_up();
    send_start(10 * SCAN);
    (void)read_bytes(bytes, sizeof bytes, 11 * SCAN);
    CHECK_BYTES(bytes + READ_SIZE, expected, sizeof expected);
}

static void a_short_read_is_followed_by_a_read_from_the_start(void)
{
    uint8_t bytes[READ_SIZE];
    power_up();
    send_start(10 * SCAN);
    (void)read_bytes(bytes, 5, 11 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 11 * SCAN), ORIGINAL_STATUS_READY);
}

static void the_status_is_not_ready_while_the_counts_are_copied(void)
{
    uint8_t bytes[READ_SIZE];
    power_up_with(0, 100.0);
    send_start(10 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 10 * SCAN + 599u * VTIME_US), ORIGINAL_STATUS_NOT_READY);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 10 * SCAN + 600u * VTIME_US), ORIGINAL_STATUS_READY);
}

static void a_command_during_a_scan_waits_for_its_end(void)
{
    uint8_t bytes[READ_SIZE];
    power_up();
    send_start(SCAN / 2);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, SCAN - 1u), ORIGINAL_STATUS_NOT_READY);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, SCAN + TAXELS * VTIME_US), ORIGINAL_STATUS_READY);
    CHECK_EQUAL(count_at(bytes, 0), 100);
}

static void only_a_single_byte_of_value_one_is_a_command(void)
{
    uint8_t bytes[READ_SIZE];
    power_up();
    write_byte(2, 10 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 11 * SCAN), ORIGINAL_STATUS_NOT_READY);
    original_board_on_address(&board);
    CHECK(original_board_on_write(&board, ORIGINAL_START_COMMAND));
    CHECK(!original_board_on_write(&board, 0)); /* the write buffer has one byte */
    original_board_on_stop(&board, 12 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 13 * SCAN), ORIGINAL_STATUS_NOT_READY);
}

/* Without a guard, a copy that is slower than the scan mixes counts of two scans. */
static void a_slow_copy_returns_counts_that_the_running_scan_has_overwritten(void)
{
    uint8_t bytes[READ_SIZE];
    power_up_with(0, 400.0); /* the converter needs 333 us for a taxel */
    send_start(10 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 20 * SCAN), ORIGINAL_STATUS_READY);
    CHECK_EQUAL(count_at(bytes, 0), 106); /* the conversion has ended 67 us before the copy */
    CHECK_EQUAL(count_at(bytes, TAXELS - 1u), 111);
}

static void a_command_while_the_counts_are_copied_is_executed_afterwards(void)
{
    uint8_t bytes[READ_SIZE];
    power_up_with(0, 100.0);
    send_start(10 * SCAN);
    send_start(10 * SCAN + 300u * VTIME_US);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 11 * SCAN - 1u), ORIGINAL_STATUS_NOT_READY);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 12 * SCAN), ORIGINAL_STATUS_READY);
    CHECK_EQUAL(count_at(bytes, 0), 106);
}

static void a_copy_that_outlasts_the_scan_does_not_lose_a_request(void)
{
    uint8_t bytes[READ_SIZE];
    power_up_with(0, 1000.0);
    send_start(10 * SCAN);
    send_start(10 * SCAN + VTIME_MS);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 20 * SCAN), ORIGINAL_STATUS_READY);
    CHECK_EQUAL(count_at(bytes, TAXELS - 1u), 117); /* third scan */
}

/* Before commit 79ee17f of the original firmware, the board gave only 2 n of its 2 n + 2 bytes to the I2C block. */
static void with_the_fault_truncated_taxel_the_last_taxel_reads_0xFFFF(void)
{
    uint8_t bytes[READ_SIZE];
    power_up_with(ORIGINAL_TRUNCATED_TAXEL, 1.0);
    send_start(10 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 11 * SCAN), ORIGINAL_STATUS_READY);
    CHECK_EQUAL(count_at(bytes, TAXELS - 2u), 104);
    CHECK_EQUAL(count_at(bytes, TAXELS - 1u), 0xFFFF);
}

static void three_accelerations_follow_the_counts_of_some_fingertips(void)
{
    uint8_t bytes[READ_SIZE + 8u];
    has_accelerations = true;
    power_up();
    has_accelerations = false;
    send_start(10 * SCAN);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 11 * SCAN), ORIGINAL_STATUS_READY);
    CHECK_EQUAL(count_at(bytes, TAXELS - 1u), 105);
    CHECK_EQUAL(count_at(bytes, TAXELS), 0);
    CHECK_EQUAL(count_at(bytes, TAXELS + 2u), 256); /* gravity along z */
    CHECK_EQUAL(count_at(bytes, TAXELS + 3u), 0xFFFF);
}

static void a_reset_clears_status_and_counts(void)
{
    uint8_t bytes[READ_SIZE];
    power_up();
    send_start(10 * SCAN);
    original_board_reset(&board, 20 * SCAN, CONVERSION);
    CHECK_EQUAL(read_bytes(bytes, sizeof bytes, 30 * SCAN), ORIGINAL_STATUS_NOT_READY);
    CHECK_EQUAL(count_at(bytes, 0), 0);
}

int main(void)
{
    RUN(the_status_is_not_ready_before_the_first_command);
    RUN(the_first_scan_starts_at_power_up);
    RUN(a_command_returns_the_counts_of_the_previous_scan);
    RUN(status_and_counts_are_little_endian);
    RUN(the_same_counts_can_be_read_again_until_the_next_command);
    RUN(bytes_after_the_end_of_the_buffer_are_0xFF);
    RUN(a_short_read_is_followed_by_a_read_from_the_start);
    RUN(the_status_is_not_ready_while_the_counts_are_copied);
    RUN(a_command_during_a_scan_waits_for_its_end);
    RUN(only_a_single_byte_of_value_one_is_a_command);
    RUN(a_slow_copy_returns_counts_that_the_running_scan_has_overwritten);
    RUN(a_command_while_the_counts_are_copied_is_executed_afterwards);
    RUN(a_copy_that_outlasts_the_scan_does_not_lose_a_request);
    RUN(with_the_fault_truncated_taxel_the_last_taxel_reads_0xFFFF);
    RUN(three_accelerations_follow_the_counts_of_some_fingertips);
    RUN(a_reset_clears_status_and_counts);
    return check_summary();
}
