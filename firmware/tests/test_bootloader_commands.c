/* Answers of the bootloader to valid and invalid packets of every kind. */
#include "check.h"
#include "test_bootloader_bench.h"

#define FIRST_A 32u
#define FIRST_B 142u
#define SLOT_ROWS 110u

static struct bench bench;
static struct bench_image image_a, image_b;

/* Start a board that ran slot A in its bootloader. image_b, for slot B, is not in its flash yet. */
static void boot(void)
{
    bench_init(&bench, &taxel_boot_layout_board, 1);
    bench_make_image(&image_a, &taxel_boot_layout_board, 0, 3, 1, 1);
    bench_make_image(&image_b, &taxel_boot_layout_board, 1, 3, 2, 2);
    bench_install(&bench, &image_a, true);
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
}

/* Start the bootloader and send the command ENTER, which must succeed. */
static void enter(void)
{
    boot();
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), TAXEL_BOOT_STATUS_OK);
}

/* Send a command whose data are a row address. Returns the status of the response. */
static unsigned send_row(uint8_t command, uint8_t array, unsigned row)
{
    const uint8_t data[3] = {array, (uint8_t)row, (uint8_t)(row >> 8)};
    return bench_send(&bench, command, data, sizeof data);
}

static void a_stock_tool_programs_the_free_slot_with_either_checksum(void)
{
    for (uint8_t checksum = TAXEL_BOOT_CHECKSUM_SUM; checksum <= TAXEL_BOOT_CHECKSUM_CRC; checksum++) {
        boot();
        bench.checksum = checksum;
        CHECK_EQUAL(bench_program(&bench, &image_b), 0);
        CHECK_EQUAL(bench.restarts, 1);
        CHECK_EQUAL(bench.running, 1);
        CHECK(bench_holds(&bench, &image_b) && bench_holds(&bench, &image_a));
        CHECK_EQUAL(bench.forbidden_writes, 0);
        CHECK_EQUAL(bench.flash.operations, 1u + 3u + 2u); /* confirmed A, rows, pending, first try */
    }
}

static void enter_reports_silicon_and_version(void)
{
    const uint8_t expected[8] = {0x93, 0x11, 0xC8, 0x04, 0x11, 1, 2, 3};
    enter();
    CHECK_EQUAL(bench.reply_size, sizeof expected);
    CHECK_BYTES(bench.reply, expected, sizeof expected);
}

static void enter_requires_the_configured_key(void)
{
    static const uint8_t key[6] = {1, 2, 3, 4, 5, 6}, other[6] = {1, 2, 3, 4, 5, 7};
    boot();
    bench.config.key = key;
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), TAXEL_BOOT_STATUS_KEY);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, other, 6), TAXEL_BOOT_STATUS_KEY);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, key, 5), TAXEL_BOOT_STATUS_LENGTH);
    CHECK_EQUAL(send_row(TAXEL_BOOT_COMMAND_VERIFY_ROW, 0, 0), TAXEL_BOOT_STATUS_COMMAND);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, key, 6), TAXEL_BOOT_STATUS_OK);
    bench.config.key = NULL;
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, other, 6), TAXEL_BOOT_STATUS_OK);
}

static void commands_before_enter_are_rejected(void)
{
    static const uint8_t commands[] = {0x31, 0x32, 0x33, 0x34, 0x35, 0x36, 0x37, 0x39, 0x3A, 0x3B, 0x3C, 0x53};
    uint8_t data[44] = {0};
    boot();
    for (unsigned i = 0; i < sizeof commands; i++) {
        for (unsigned size = 0; size <= sizeof data; size++) {
            CHECK_EQUAL(bench_send(&bench, commands[i], data, size), TAXEL_BOOT_STATUS_COMMAND);
        }
    }
    CHECK_EQUAL(bench.flash.operations, 1);
    CHECK_EQUAL(bench.restarts, 0);
}

static void unknown_commands_are_rejected(void)
{
    enter();
    for (unsigned command = 0; command < 256; command++) {
        if ((command < 0x31 || command > 0x3C) && (command < 0x50 || command > 0x53)) {
            CHECK_EQUAL(bench_send(&bench, (uint8_t)command, NULL, 0), TAXEL_BOOT_STATUS_COMMAND);
        }
    }
}

static void a_wrong_data_length_is_rejected_for_every_command(void)
{
    static const struct {
        uint8_t command, length;
    } commands[] = {{0x31, 0}, {0x32, 1}, {0x33, 1}, {0x34, 3}, {0x35, 0}, {0x36, 1}, {0x3A, 3},
                    {0x3B, 0}, {0x3C, 1}, {0x50, 0}, {0x51, 9}, {0x52, 0}, {0x53, 44}};
    uint8_t data[57] = {0};
    enter();
    for (unsigned i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        for (unsigned size = 0; size <= sizeof data; size++) {
            if (size != commands[i].length) {
                CHECK_EQUAL(bench_send(&bench, commands[i].command, data, size), TAXEL_BOOT_STATUS_LENGTH);
            }
        }
    }
    for (unsigned size = 0; size < 3; size++) {
        CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_PROGRAM_ROW, data, size), TAXEL_BOOT_STATUS_LENGTH);
    }
    CHECK_EQUAL(bench.flash.operations, 1);
    CHECK_EQUAL(bench.restarts, 0);
}

/* Send bytes to the bootloader. Returns the status of the response, or BENCH_NO_REPLY. */
static unsigned status_of(const uint8_t *bytes, unsigned size)
{
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
    return bench_exchange(&bench, bytes, size, response) ? response[1] : BENCH_NO_REPLY;
}

static void malformed_packets_are_answered_with_the_reason(void)
{
    uint8_t good[TAXEL_BOOT_PACKET_MAX], bytes[TAXEL_BOOT_PACKET_MAX + 40] = {0};
    const uint8_t data[57] = {1, 2, 3};
    enter();
    const unsigned size = bench_packet(&bench, TAXEL_BOOT_COMMAND_SEND_DATA, data, sizeof data, good);
    CHECK_EQUAL(size, TAXEL_BOOT_PACKET_MAX);
    for (unsigned part = 1; part < size; part++) { /* truncated packets */
        CHECK_EQUAL(status_of(good, part), TAXEL_BOOT_STATUS_LENGTH);
    }
    memcpy(bytes, good, size);
    for (unsigned longer = size + 1u; longer < sizeof bytes; longer++) {
        CHECK_EQUAL(status_of(bytes, longer), TAXEL_BOOT_STATUS_LENGTH);
    }
    for (unsigned length = 0; length < 0x10000; length += 97) { /* a length field larger than the packet */
        memcpy(bytes, good, size);
        taxel_put_u16(bytes + 2, (uint16_t)length);
        if (length != sizeof data) {
            CHECK_EQUAL(status_of(bytes, size), TAXEL_BOOT_STATUS_LENGTH);
        }
    }
    memcpy(bytes, good, size);
    bytes[size - 1u] = 0x18;
    CHECK_EQUAL(status_of(bytes, size), TAXEL_BOOT_STATUS_DATA);
    for (unsigned bit = 8; bit < 8u * (size - 1u); bit++) {
        if (bit / 8u != 2 && bit / 8u != 3) {
            memcpy(bytes, good, size);
            bytes[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
            CHECK_EQUAL(status_of(bytes, size), TAXEL_BOOT_STATUS_CHECKSUM);
        }
    }
    CHECK_EQUAL(bench.boot.fill, 0);
}

static void the_first_packet_selects_the_checksum_of_a_session(void)
{
    enter();
    bench.checksum = TAXEL_BOOT_CHECKSUM_CRC;
    /* answered with the previous checksum */
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0), BENCH_NOT_A_PACKET);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), TAXEL_BOOT_STATUS_OK);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0), TAXEL_BOOT_STATUS_OK);
    bench.config.checksum = TAXEL_BOOT_CHECKSUM_CRC;
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), TAXEL_BOOT_STATUS_OK);
    bench.checksum = TAXEL_BOOT_CHECKSUM_SUM;
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), BENCH_NOT_A_PACKET);
}

static void only_the_free_slot_is_written(void)
{
    uint8_t row_bytes[TAXEL_BOOT_ROW_SIZE];
    enter();
    memset(row_bytes, 0x5A, sizeof row_bytes);
    for (unsigned row = 0; row < 300; row++) {
        unsigned expected = TAXEL_BOOT_STATUS_ROW_PROTECTED;
        if (row >= FIRST_A && row < FIRST_B) {
            expected = TAXEL_BOOT_STATUS_ACTIVE;
        } else if (row >= FIRST_B && row < FIRST_B + SLOT_ROWS) {
            expected = TAXEL_BOOT_STATUS_OK;
        } else if (row >= TAXEL_BOOT_ROW_COUNT) {
            expected = TAXEL_BOOT_STATUS_ROW;
        }
        CHECK_EQUAL(bench_program_row(&bench, (uint16_t)row, row_bytes), expected);
        CHECK_EQUAL(send_row(TAXEL_BOOT_COMMAND_ERASE_ROW, 0, row), expected);
        CHECK_EQUAL(send_row(TAXEL_BOOT_COMMAND_ERASE_ROW, 1, row), TAXEL_BOOT_STATUS_ARRAY);
    }
    CHECK_EQUAL(bench.forbidden_writes, 0);
    for (unsigned row = 0; row < TAXEL_BOOT_ROW_COUNT; row++) {
        const bool is_free = row >= FIRST_B && row < FIRST_B + SLOT_ROWS;
        CHECK_EQUAL(bench.flash.wear[row], is_free ? 2 : row == TAXEL_BOOT_METADATA_ROW ? 1 : 0);
    }
    CHECK(bench_holds(&bench, &image_a));
}

static void flash_size_reports_the_rows_of_the_free_slot(void)
{
    const uint8_t array[2] = {0, 1};
    enter();
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_FLASH_SIZE, array, 1), TAXEL_BOOT_STATUS_OK);
    CHECK_EQUAL(taxel_get_u16(bench.reply), FIRST_B);
    CHECK_EQUAL(taxel_get_u16(bench.reply + 2), FIRST_B + SLOT_ROWS - 1u);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_FLASH_SIZE, array + 1, 1), TAXEL_BOOT_STATUS_ARRAY);
}

static void data_beyond_a_row_is_rejected_and_discarded(void)
{
    uint8_t data[57];
    memset(data, 0x33, sizeof data);
    enter();
    for (unsigned size = 1; size <= 57; size++) {
        unsigned fill = 0;
        for (unsigned i = 0; i < 300; i++) {
            const unsigned status = bench_send(&bench, TAXEL_BOOT_COMMAND_SEND_DATA, data, size);
            const bool fits = fill + size <= TAXEL_BOOT_ROW_SIZE;
            CHECK_EQUAL(status, fits ? TAXEL_BOOT_STATUS_OK : TAXEL_BOOT_STATUS_LENGTH);
            fill = fits ? fill + size : 0;
            CHECK_EQUAL(bench.boot.fill, fill);
        }
        CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SYNC, NULL, 0), BENCH_NO_REPLY);
        CHECK_EQUAL(bench.boot.fill, 0);
    }
    CHECK_EQUAL(bench.flash.operations, 1);
}

static void an_incomplete_row_is_not_written(void)
{
    uint8_t data[57] = {0, FIRST_B, 0};
    for (unsigned fill = 0; fill < TAXEL_BOOT_ROW_SIZE; fill++) {
        enter();
        for (unsigned remaining = fill; remaining;) {
            const unsigned size = remaining < 57u ? remaining : 57u;
            CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SEND_DATA, data, size), TAXEL_BOOT_STATUS_OK);
            remaining -= size;
        }
        for (unsigned size = 0; size <= 54; size += 9) {
            const unsigned expected =
                fill + size == TAXEL_BOOT_ROW_SIZE ? TAXEL_BOOT_STATUS_OK : TAXEL_BOOT_STATUS_LENGTH;
            if (size) {
                CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_PROGRAM_ROW, data, 3u + size), expected);
                break;
            }
        }
    }
}

static void unchanged_rows_are_not_written_again(void)
{
    enter();
    CHECK_EQUAL(bench_program_row(&bench, FIRST_B, image_b.bytes), TAXEL_BOOT_STATUS_OK);
    CHECK_EQUAL(bench_program_row(&bench, FIRST_B, image_b.bytes), TAXEL_BOOT_STATUS_OK);
    CHECK_EQUAL(bench.flash.wear[FIRST_B], 1);
}

static void a_failed_row_write_is_reported(void)
{
    enter();
    bench.flash.is_worn_out = true;
    CHECK_EQUAL(bench_program_row(&bench, FIRST_B, image_b.bytes), TAXEL_BOOT_STATUS_VERIFY);
    bench.flash.is_worn_out = false;
    bench.flash.is_stuck = true;
    CHECK_EQUAL(bench_program_row(&bench, FIRST_B, image_b.bytes), TAXEL_BOOT_STATUS_VERIFY);
}

static void a_damaged_image_is_not_made_pending(void)
{
    for (unsigned byte = 0; byte < image_b.size - 12u; byte += 7) {
        boot();
        image_b.bytes[byte] ^= 0x10;
        CHECK_EQUAL(bench_program(&bench, &image_b), BENCH_NO_SLOT + 1);
        CHECK_EQUAL(bench.reply[0], 0);
        CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_EXIT, NULL, 0), BENCH_NO_REPLY);
        bench_settle(&bench);
        CHECK_EQUAL(bench.running, 0);
        CHECK_EQUAL(bench.flash.operations, 4);
    }
}

static void verifying_an_old_image_does_not_make_it_pending(void)
{
    boot();
    bench_install(&bench, &image_b, false);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), 0);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_VERIFY_APPLICATION, NULL, 0), 0);
    CHECK_EQUAL(bench.reply[0], 1);
    CHECK_EQUAL(bench.flash.operations, 1);
}

static void the_host_can_select_a_slot_with_a_valid_image(void)
{
    const uint8_t slots[3] = {0, 1, 2};
    enter();
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SET_ACTIVE, slots + 1, 1), TAXEL_BOOT_STATUS_APPLICATION);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SET_ACTIVE, slots + 2, 1), TAXEL_BOOT_STATUS_APPLICATION);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_APPLICATION_STATUS, slots + 2, 1),
                TAXEL_BOOT_STATUS_APPLICATION);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_APPLICATION_STATUS, slots, 1), 0);
    CHECK(bench.reply_size == 2 && bench.reply[0] == 0 && bench.reply[1] == 1);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_APPLICATION_STATUS, slots + 1, 1), 0);
    CHECK(bench.reply[0] == 1 && bench.reply[1] == 0);
    bench_install(&bench, &image_b, false);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SET_ACTIVE, slots + 1, 1), 0);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0), 0);
    CHECK(bench.reply[4] == 0 && bench.reply[5] == 1);
    /* the host cancels the pending image */
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SET_ACTIVE, slots, 1), 0);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0), 0);
    CHECK(bench.reply[4] == 0 && bench.reply[5] == TAXEL_BOOT_SLOT_NONE);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SET_ACTIVE, slots + 1, 1), 0);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_EXIT, NULL, 0), BENCH_NO_REPLY);
    CHECK_EQUAL(bench.running, 1);
}

/* Slot B has no valid image, so its metadata cannot be read. */
static void metadata_are_reported_in_the_stock_format(void)
{
    const uint8_t slots[2] = {0, 1};
    enter();
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_METADATA, slots + 1, 1), TAXEL_BOOT_STATUS_APPLICATION);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_METADATA, slots, 1), 0);
    CHECK_EQUAL(bench.reply_size, 56);
    CHECK_EQUAL(taxel_get_u32(bench.reply + 1), FIRST_A * 128u + 32u);
    CHECK_EQUAL(taxel_get_u16(bench.reply + 5), 31);
    CHECK_EQUAL(taxel_get_u32(bench.reply + 9), image_a.size - 12u);
    CHECK(bench.reply[16] == 1 && bench.reply[17] == 1);
    CHECK_EQUAL(taxel_get_u16(bench.reply + 18), 0x0102);
    CHECK_EQUAL(taxel_get_u16(bench.reply + 22), 0x0100);
    CHECK_EQUAL(taxel_get_u32(bench.reply + 24), taxel_get_u32(image_a.bytes + 28));
}

/* The host begins a new session after one data packet of a row. */
static void a_host_may_restart_a_session_at_any_time(void)
{
    enter();
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SEND_DATA, image_b.bytes, 57), 0);
    CHECK_EQUAL(bench_program(&bench, &image_b), 0);
    CHECK_EQUAL(bench.running, 1);
}

int main(void)
{
    RUN(a_stock_tool_programs_the_free_slot_with_either_checksum);
    RUN(enter_reports_silicon_and_version);
    RUN(enter_requires_the_configured_key);
    RUN(commands_before_enter_are_rejected);
    RUN(unknown_commands_are_rejected);
    RUN(a_wrong_data_length_is_rejected_for_every_command);
    RUN(malformed_packets_are_answered_with_the_reason);
    RUN(the_first_packet_selects_the_checksum_of_a_session);
    RUN(only_the_free_slot_is_written);
    RUN(flash_size_reports_the_rows_of_the_free_slot);
    RUN(data_beyond_a_row_is_rejected_and_discarded);
    RUN(an_incomplete_row_is_not_written);
    RUN(unchanged_rows_are_not_written_again);
    RUN(a_failed_row_write_is_reported);
    RUN(a_damaged_image_is_not_made_pending);
    RUN(verifying_an_old_image_does_not_make_it_pending);
    RUN(the_host_can_select_a_slot_with_a_valid_image);
    RUN(metadata_are_reported_in_the_stock_format);
    RUN(a_host_may_restart_a_session_at_any_time);
    return check_summary();
}
