/* The firmware of the original hub on a simulated bus: poll cycle, failed boards, messages, timestamps and known
 * faults. */
#include "check.h"
#include "emulator/original/original_hub.h"

#define BOARDS 3u
#define TAXELS 4u
#define READ_TIME VTIME_MS
#define CALL_TIME (100u * VTIME_US)
#define TRANSFERS_MAX 4096u
#define STREAM_MAX 65536u
#define MESSAGE_SIZE (2u * TAXELS + 8u)

static struct original_settings settings;
static struct original_hub hub;
static vtime now;

/* The simulated boards, by index: address 0x10 + index, raw counts 0x0100 * (index + 1) + taxel. */
static struct {
    bool is_absent;
    unsigned not_ready; /* the next reads have the status 0 */
} boards[BOARDS];
static bool call_fails, lines_are_held;

/* What the hub has done. */
static uint8_t transfer_addresses[TRANSFERS_MAX];
static vtime transfer_times[TRANSFERS_MAX];
static size_t transfer_count;
static uint8_t stream[STREAM_MAX];
static size_t stream_size;

static int8_t pending_result;
static vtime transfer_end, wire_free;

/* Write the reply of a board that acknowledges: status and counts. */
static void write_reply(unsigned index, uint8_t *bytes, size_t size)
{
    taxel_put_u16(bytes, boards[index].not_ready ? ORIGINAL_STATUS_NOT_READY : ORIGINAL_STATUS_READY);
    for (size_t i = 0; 2u + 2u * i < size; i++) {
        taxel_put_u16(bytes + 2u + 2u * i, (uint16_t)(0x0100u * (index + 1u) + i));
    }
    boards[index].not_ready -= boards[index].not_ready > 0;
}

/* Record a transfer and prepare its result; function of the original hub's HAL. */
static void on_start_transfer(void *context, const struct taxel_i2c_transfer *transfer)
{
    (void)context;
    transfer_addresses[transfer_count] = transfer->address;
    transfer_times[transfer_count++] = now;
    pending_result = lines_are_held ? TAXEL_I2C_BUSY : TAXEL_I2C_OK;
    if (transfer->address == 0) {
        pending_result = call_fails && !lines_are_held ? TAXEL_I2C_NACK_ADDRESS : pending_result;
        CHECK_EQUAL(transfer->write_size, 1);
        CHECK_EQUAL(transfer->write_bytes[0], ORIGINAL_START_COMMAND);
        transfer_end = now + CALL_TIME;
        return;
    }
    const unsigned index = transfer->address - 0x10u;
    CHECK_EQUAL(transfer->write_size, 0);
    if (boards[index].is_absent && !lines_are_held) {
        pending_result = TAXEL_I2C_NACK_ADDRESS;
    } else if (!lines_are_held) {
        write_reply(index, transfer->read_bytes, transfer->read_size);
    }
    transfer_end = now + READ_TIME;
}

/* Do nothing, because run_ms() offers the wire whenever it is free; function of the original hub's HAL. */
static void on_start_transmit(void *context)
{
    (void)context;
}

/* Describe a hub with BOARDS boards of `taxels` taxels and the default settings, which the test may change before
 * start(). */
static void describe(uint8_t taxels)
{
    original_settings_set_defaults(&settings);
    memset(boards, 0, sizeof boards);
    call_fails = lines_are_held = false;
    settings.list_size = BOARDS;
    for (unsigned i = 0; i < BOARDS; i++) {
        settings.list[i] =
            (struct original_board_entry){.address = (uint8_t)(0x10u + i), .taxels = taxels, .words = taxels};
    }
}

/* Start the described hub at virtual time 0. */
static void start(void)
{
    const struct original_hub_hal hal = {.start_transfer = on_start_transfer, .start_transmit = on_start_transmit};
    original_hub_init(&hub, &settings, &hal, 115200.0, 1.0);
    now = wire_free = 0;
    transfer_count = stream_size = 0;
    transfer_end = VTIME_NEVER;
    original_hub_reset(&hub, now);
}

/* Run the hub, its transfers and its wire for a time in ms. */
static void run_ms(double milliseconds)
{
    const vtime until = now + (vtime)(milliseconds * (double)VTIME_MS);
    for (;;) {
        const bool has_bytes = hub.sender.is_paced ? hub.sender.fifo_fill > 0 : original_sender_has_bytes(&hub.sender);
        const vtime pull = has_bytes ? vtime_max(now, wire_free) : VTIME_NEVER;
        const vtime next = vtime_min(vtime_min(transfer_end, pull), original_hub_next_time(&hub, now));
        if (next > until) {
            break;
        }
        now = next;
        if (transfer_end == now) {
            transfer_end = VTIME_NEVER;
            original_hub_on_transfer_done(&hub, pending_result, now);
        } else if (pull == now) {
            stream_size += original_hub_pull(&hub, stream + stream_size, ORIGINAL_FIFO_SIZE, now);
            wire_free = hub.sender.wire_end;
        } else {
            original_hub_run(&hub, now);
        }
    }
    now = until;
}

/* Return the number of transfers with this address from transfer number `first` on. */
static unsigned count_transfers(uint8_t address, size_t first)
{
    unsigned count = 0;
    for (size_t i = first; i < transfer_count; i++) {
        count += transfer_addresses[i] == address;
    }
    return count;
}

/* Return the timestamp of the message number `message` of the stream. */
static uint32_t timestamp_of(size_t message)
{
    const uint8_t *bytes = stream + message * MESSAGE_SIZE + 3u;
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

static void a_cycle_is_a_general_call_and_one_read_of_each_board_in_list_order(void)
{
    const uint8_t expected[5] = {0x00, 0x12, 0x10, 0x11, 0x00};
    describe(TAXELS);
    settings.list[0].address = 0x12;
    settings.list[1].address = 0x10;
    settings.list[2].address = 0x11;
    start();
    run_ms(100);
    CHECK_BYTES(transfer_addresses, expected, sizeof expected);
}

static void the_next_cycle_begins_50_ms_after_the_last_board(void)
{
    describe(TAXELS);
    start();
    run_ms(100);
    CHECK_EQUAL(transfer_times[4], CALL_TIME + 3u * READ_TIME + 50u * VTIME_MS);
}

static void after_a_failed_general_call_only_the_delay_follows(void)
{
    describe(TAXELS);
    call_fails = true;
    start();
    run_ms(100);
    CHECK_EQUAL(transfer_count, 2);
    CHECK_EQUAL(transfer_addresses[1], 0);
    CHECK_EQUAL(transfer_times[1], CALL_TIME + 50u * VTIME_MS);
}

static void a_message_contains_address_big_endian_timestamp_and_little_endian_counts(void)
{
    const uint8_t expected[MESSAGE_SIZE] = {0x01, MESSAGE_SIZE, 0x11, 0, 0, 0, 2, 0, 2, 1, 2, 2, 2, 3, 2, 0x0A};
    describe(TAXELS);
    start();
    run_ms(50);
    CHECK_EQUAL(stream_size, 3u * MESSAGE_SIZE);
    CHECK_BYTES(stream + MESSAGE_SIZE, expected, sizeof expected); /* read from 1.1 ms to 2.1 ms */
}

static void without_timestamp_a_message_is_four_bytes_shorter(void)
{
    const uint8_t expected[MESSAGE_SIZE - 4u] = {0x01, MESSAGE_SIZE - 4u, 0x10, 0, 1, 1, 1, 2, 1, 3, 1, 0x0A};
    describe(TAXELS);
    settings.message = ORIGINAL_WITHOUT_TIMESTAMP;
    start();
    run_ms(50);
    CHECK_BYTES(stream, expected, sizeof expected);
}

static void with_high_byte_first_the_counts_are_big_endian(void)
{
    const uint8_t expected[MESSAGE_SIZE] = {0x01, MESSAGE_SIZE, 0x10, 0, 0, 0, 1, 1, 0, 1, 1, 1, 2, 1, 3, 0x0A};
    describe(TAXELS);
    settings.message = ORIGINAL_HIGH_BYTE_FIRST;
    start();
    run_ms(50);
    CHECK_BYTES(stream, expected, sizeof expected);
}

static void a_board_that_is_not_ready_is_read_again_after_the_other_boards(void)
{
    const uint8_t expected[5] = {0x00, 0x10, 0x11, 0x12, 0x10};
    describe(TAXELS);
    boards[0].not_ready = 1;
    start();
    run_ms(50);
    CHECK_EQUAL(transfer_count, 5);
    CHECK_BYTES(transfer_addresses, expected, sizeof expected);
    CHECK_EQUAL(hub.account.failed_tries, 1);
    CHECK_EQUAL(stream[2], 0x11); /* the message of board 0x10 is the last one */
}

static void the_main_variant_skips_a_board_after_five_tries_in_this_cycle_only(void)
{
    describe(TAXELS);
    boards[1].is_absent = true;
    start();
    run_ms(40);
    CHECK_EQUAL(count_transfers(0x11, 0), 5);
    const size_t second_cycle = transfer_count;
    run_ms(50);
    CHECK_EQUAL(count_transfers(0x11, second_cycle), 5);
    boards[1].is_absent = false;
    const size_t third_cycle = transfer_count;
    run_ms(50);
    CHECK_EQUAL(count_transfers(0x11, third_cycle), 1);
}

static void in_the_branch_variant_a_board_is_offline_after_ten_tries_until_the_hub_is_reset(void)
{
    describe(TAXELS);
    settings.variant = ORIGINAL_BRANCH;
    boards[1].is_absent = true;
    start();
    run_ms(40);
    CHECK_EQUAL(count_transfers(0x11, 0), 10);
    boards[1].is_absent = false;
    run_ms(1000);
    CHECK_EQUAL(count_transfers(0x11, 0), 10);
    const size_t after_reset = transfer_count;
    original_hub_reset(&hub, now);
    run_ms(20);
    CHECK_EQUAL(count_transfers(0x11, after_reset), 1);
}

static void tries_of_the_branch_variant_are_counted_for_each_cycle_alone(void)
{
    describe(TAXELS);
    settings.variant = ORIGINAL_BRANCH;
    start();
    for (unsigned cycle = 0; cycle < 5; cycle++) {
        boards[1].not_ready = 9;
        run_ms(70);
        CHECK(!hub.is_offline[1]);
    }
}

static void with_the_fault_wait_for_ever_a_held_line_stops_the_hub_until_its_reset(void)
{
    describe(TAXELS);
    settings.faults = ORIGINAL_WAIT_FOR_EVER;
    start();
    run_ms(20);
    lines_are_held = true;
    run_ms(100);
    lines_are_held = false;
    const size_t before = transfer_count;
    run_ms(10000);
    CHECK_EQUAL(transfer_count, before);
    CHECK_EQUAL(hub.state, ORIGINAL_HUB_HANGS);
    original_hub_reset(&hub, now);
    run_ms(20);
    CHECK_EQUAL(transfer_count, before + 4u);
}

static void without_the_fault_wait_for_ever_the_hub_continues_after_a_held_line(void)
{
    describe(TAXELS);
    start();
    run_ms(20);
    lines_are_held = true;
    run_ms(100);
    lines_are_held = false;
    const uint64_t before = hub.account.messages;
    run_ms(200);
    CHECK_BETWEEN(hub.account.messages - before, 6, 12);
}

static void timestamps_are_milliseconds_since_the_reset_when_the_message_is_built(void)
{
    describe(TAXELS);
    start();
    run_ms(120);
    CHECK_EQUAL(timestamp_of(0), 1); /* 1.1 ms */
    CHECK_EQUAL(timestamp_of(2), 3);
    CHECK_EQUAL(timestamp_of(3), 54); /* 53.1 + 0.1 + 1 = 54.2 ms: second cycle */
}

static void the_timer_loses_multiples_of_65536_ms_between_two_messages(void)
{
    describe(TAXELS);
    call_fails = true;
    start();
    run_ms(70000);
    call_fails = false;
    run_ms(100);
    CHECK_BETWEEN(timestamp_of(0), 70000 - 65536, 70060 - 65536);
}

static void with_the_fault_stale_timestamp_a_message_has_the_time_of_the_one_before(void)
{
    describe(TAXELS);
    settings.faults = ORIGINAL_STALE_TIMESTAMP;
    start();
    run_ms(120);
    CHECK_EQUAL(timestamp_of(0), 0);
    CHECK_EQUAL(timestamp_of(1), 1);
    CHECK_EQUAL(timestamp_of(3), 3);
}

/* Before commit 79ee17f, the hub sent n + 5 bytes of the receive buffer, so that the low byte of the status is in the
 * place of the address. */
static void with_the_fault_wrong_buffer_half_of_the_taxels_are_missing(void)
{
    const uint8_t expected[TAXELS + 8u] = {0x01, TAXELS + 8u, 0xFE, 0xFF, 0, 1, 1, 1, 2, 1, 3, 0x0A};
    describe(TAXELS);
    settings.faults = ORIGINAL_WRONG_BUFFER;
    start();
    run_ms(50);
    CHECK_BYTES(stream, expected, sizeof expected);
}

/* A read of 25 taxels has 52 bytes. The receive buffer has 50 bytes, and the message follows it in memory. */
static void with_the_fault_receive_buffer_address_and_time_overwrite_the_25th_taxel(void)
{
    describe(25);
    settings.faults = ORIGINAL_RECEIVE_BUFFER;
    start();
    run_ms(50);
    CHECK_EQUAL(stream[1], 58);
    CHECK_EQUAL(taxel_get_u16(stream + 7u + 2u * 23u), 0x0117);
    CHECK_EQUAL(stream[7u + 2u * 24u], 0x10);      /* address of the board */
    CHECK_EQUAL(stream[7u + 2u * 24u + 1u], 0x00); /* most significant byte of the timestamp */
}

static void with_a_sufficient_receive_buffer_the_25th_taxel_arrives(void)
{
    describe(25);
    start();
    run_ms(50);
    CHECK_EQUAL(taxel_get_u16(stream + 7u + 2u * 24u), 0x0118);
}

static void the_times_of_the_account_add_up_to_the_time_of_the_cycles(void)
{
    describe(100);
    boards[2].is_absent = true;
    start();
    run_ms(5000);
    const struct original_account account = original_hub_measure_cycles(&hub);
    CHECK(account.cycles > 10);
    CHECK_EQUAL(account.call_time + account.read_time + account.retry_time + account.blocked_time + account.delay_time,
                account.time);
    CHECK_EQUAL(account.failed_tries, 5u * account.cycles);
    CHECK_EQUAL(account.delay_time, account.cycles * 50u * VTIME_MS);
}

int main(void)
{
    RUN(a_cycle_is_a_general_call_and_one_read_of_each_board_in_list_order);
    RUN(the_next_cycle_begins_50_ms_after_the_last_board);
    RUN(after_a_failed_general_call_only_the_delay_follows);
    RUN(a_message_contains_address_big_endian_timestamp_and_little_endian_counts);
    RUN(without_timestamp_a_message_is_four_bytes_shorter);
    RUN(with_high_byte_first_the_counts_are_big_endian);
    RUN(a_board_that_is_not_ready_is_read_again_after_the_other_boards);
    RUN(the_main_variant_skips_a_board_after_five_tries_in_this_cycle_only);
    RUN(in_the_branch_variant_a_board_is_offline_after_ten_tries_until_the_hub_is_reset);
    RUN(tries_of_the_branch_variant_are_counted_for_each_cycle_alone);
    RUN(with_the_fault_wait_for_ever_a_held_line_stops_the_hub_until_its_reset);
    RUN(without_the_fault_wait_for_ever_the_hub_continues_after_a_held_line);
    RUN(timestamps_are_milliseconds_since_the_reset_when_the_message_is_built);
    RUN(the_timer_loses_multiples_of_65536_ms_between_two_messages);
    RUN(with_the_fault_stale_timestamp_a_message_has_the_time_of_the_one_before);
    RUN(with_the_fault_wrong_buffer_half_of_the_taxels_are_missing);
    RUN(with_the_fault_receive_buffer_address_and_time_overwrite_the_25th_taxel);
    RUN(with_a_sufficient_receive_buffer_the_25th_taxel_arrives);
    RUN(the_times_of_the_account_add_up_to_the_time_of_the_cycles);
    return check_summary();
}
