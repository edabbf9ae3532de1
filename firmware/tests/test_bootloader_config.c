/* The configuration rows: written only on the addressed board, read back, safe against a power cut. */
#include "bootloader/internal.h"
#include "check.h"
#include "codec/crc32.h"
#include "test_bootloader_bench.h"

#define DATA_SIZE TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_SIZE

static struct bench bench, start;
static jmp_buf power;

/* Start a board with erased flash in its bootloader and send the command ENTER. */
static void boot(void)
{
    bench_init(&bench, &taxel_boot_layout_board, 5);
    bench.flash.power = &power;
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), 0);
}

/* Fill the arguments of WRITE_CONFIGURATION: unique id of the board, address, kind, serial number and current
 * codes. */
static void fill(uint8_t *data, uint8_t address, uint8_t kind)
{
    memset(data, 0, DATA_SIZE);
    memcpy(data, bench.unique_id, 8);
    data[8] = TAXEL_BOOT_VERSION;
    data[9] = address;
    data[10] = kind;
    memcpy(data + 12, "TX-0042", 7);
    for (uint8_t i = 0; i < 16; i++) {
        data[28 + i] = (uint8_t)(90u + i + address);
    }
}

/* Send the command WRITE_CONFIGURATION. Returns the status of the response. */
static unsigned write_configuration(const uint8_t *data)
{
    return bench_send(&bench, TAXEL_BOOT_COMMAND_WRITE_CONFIGURATION, data, DATA_SIZE);
}

static void a_board_without_configuration_reports_it(void)
{
    boot();
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_READ_CONFIGURATION, NULL, 0), TAXEL_BOOT_STATUS_DATA);
    CHECK(taxel_boot_configuration(&bench.config.flash) == NULL);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0), 0);
    CHECK_EQUAL(bench.reply_size, TAXEL_BOOT_INFO_SIZE);
    CHECK_EQUAL(bench.reply[TAXEL_BOOT_INFO_OFFSET_ADDRESS], TAXEL_BOOT_DEFAULT_ADDRESS);
    CHECK_BYTES(bench.reply + TAXEL_BOOT_INFO_OFFSET_UNIQUE_ID, bench.unique_id, 8);
}

static void a_written_configuration_is_read_back(void)
{
    uint8_t data[DATA_SIZE];
    boot();
    fill(data, 0x23, 3);
    CHECK_EQUAL(write_configuration(data), 0);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_READ_CONFIGURATION, NULL, 0), 0);
    CHECK_EQUAL(bench.reply_size, TAXEL_BOOT_CONFIGURATION_SIZE);
    CHECK_BYTES(bench.reply, data + 8, TAXEL_BOOT_CONFIGURATION_SIZE);
    CHECK_EQUAL(taxel_boot_i2c_address(&bench.config.flash), 0x23);
    CHECK_BYTES(taxel_boot_configuration(&bench.config.flash), data + 8, TAXEL_BOOT_CONFIGURATION_SIZE);
    const unsigned operations = bench.flash.operations;
    CHECK_EQUAL(write_configuration(data), 0);
    CHECK_EQUAL(bench.flash.operations, operations);
}

static void an_invalid_configuration_is_rejected(void)
{
    uint8_t data[DATA_SIZE];
    boot();
    for (unsigned address = 0; address < 256; address++) {
        fill(data, (uint8_t)address, 1);
        CHECK_EQUAL(write_configuration(data), address >= 0x08 && address <= 0x77 ? 0 : TAXEL_BOOT_STATUS_DATA);
    }
    fill(data, 0x20, 1);
    data[8]++;
    CHECK_EQUAL(write_configuration(data), TAXEL_BOOT_STATUS_VERSION);
    for (unsigned bit = 0; bit < 64; bit++) {
        fill(data, 0x20, 1);
        data[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        CHECK_EQUAL(write_configuration(data), TAXEL_BOOT_STATUS_DEVICE);
    }
    CHECK_EQUAL(taxel_boot_i2c_address(&bench.config.flash), 0x77);
    bench.flash.is_worn_out = true;
    fill(data, 0x20, 1);
    CHECK_EQUAL(write_configuration(data), TAXEL_BOOT_STATUS_VERIFY);
}

static void a_power_cut_leaves_the_old_or_the_new_configuration(void)
{
    uint8_t old_data[DATA_SIZE], new_data[DATA_SIZE];
    static unsigned old_left, new_left;
    old_left = new_left = 0;
    boot();
    fill(old_data, 0x20, 1);
    CHECK_EQUAL(write_configuration(old_data), 0);
    start = bench;
    for (volatile unsigned before = 0; before < 2; before++) { /* either row */
        for (volatile unsigned tear = 0; tear < FAKE_TEAR_COUNT; tear++) {
            for (volatile unsigned word = 0; word <= FAKE_FLASH_WORDS; word++) {
                bench = start;
                if (before) {
                    fill(new_data, 0x55, 1);
                    CHECK_EQUAL(write_configuration(new_data), 0);
                    CHECK_EQUAL(write_configuration(old_data), 0);
                    fill(new_data, 0x56, 1);
                    CHECK_EQUAL(write_configuration(new_data), 0);
                    CHECK_EQUAL(write_configuration(old_data), 0);
                    fill(new_data, 0x57, 1);
                }
                fill(new_data, 0x21, 2);
                fake_flash_plan(&bench.flash, (struct fake_cut){1, (uint8_t)tear, (uint8_t)word});
                if (setjmp(power) == 0) {
                    (void)write_configuration(new_data);
                    CHECK(false);
                }
                const uint8_t *const configuration = taxel_boot_configuration(&bench.config.flash);
                const bool is_old =
                    configuration && memcmp(configuration, old_data + 8, TAXEL_BOOT_CONFIGURATION_SIZE) == 0;
                const bool is_new =
                    configuration && memcmp(configuration, new_data + 8, TAXEL_BOOT_CONFIGURATION_SIZE) == 0;
                CHECK(is_old || is_new);
                old_left += is_old;
                new_left += is_new;
            }
        }
    }
    CHECK_EQUAL(old_left + new_left, 2u * FAKE_TEAR_COUNT * (FAKE_FLASH_WORDS + 1u));
    CHECK(old_left && new_left);
}

static void an_image_for_another_kind_does_not_start(void)
{
    static struct bench_image image;
    uint8_t data[DATA_SIZE];
    for (uint8_t kind = 0; kind < 3; kind++) {
        boot();
        bench_make_image(&image, &taxel_boot_layout_board, 0, 1, 1, 1);
        struct taxel_boot_image_header header;
        taxel_boot_image_header_unpack(&header, image.bytes);
        header.kind = kind;
        taxel_boot_image_header_pack(&header, image.bytes);
        uint32_t crc = taxel_crc32(0, image.bytes, 28);
        crc = taxel_crc32(crc, image.bytes + 32, header.length - 32u);
        taxel_put_u32(image.bytes + 28, crc);
        bench_install(&bench, &image, true);
        fill(data, 0x20, 2);
        CHECK_EQUAL(write_configuration(data), 0);
        bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
        CHECK_EQUAL(bench.running, kind == 1 ? BENCH_NO_SLOT : 0); /* 0: any kind, 2: the board's own kind */
    }
}

/* Found by a search over the last word: with this content and sequence number 0, the words including the CRC-32 add up
 * to zero. */
static void a_record_whose_words_add_up_to_zero_is_balanced(void)
{
    uint8_t content[112] = {2};
    taxel_put_u32(content + 108, 0xEFAAAE75u);
    boot();
    CHECK_EQUAL(taxel_boot_record_write(&bench.config.flash, TAXEL_BOOT_CONFIGURATION_ROW,
                                        TAXEL_BOOT_CONFIGURATION_MAGIC, content, sizeof content),
                0);
    const uint8_t *const row = bench.flash.bytes + TAXEL_BOOT_CONFIGURATION_ROW * TAXEL_BOOT_ROW_SIZE;
    CHECK_EQUAL(taxel_get_u32(row + TAXEL_BOOT_RECORD_OFFSET_BALANCE), 1);
    CHECK_EQUAL(bench.flash.zero_sums, 0);
    CHECK_BYTES(taxel_boot_configuration(&bench.config.flash), content, sizeof content);
}

int main(void)
{
    RUN(a_board_without_configuration_reports_it);
    RUN(a_written_configuration_is_read_back);
    RUN(an_invalid_configuration_is_rejected);
    RUN(a_power_cut_leaves_the_old_or_the_new_configuration);
    RUN(an_image_for_another_kind_does_not_start);
    RUN(a_record_whose_words_add_up_to_zero_is_balanced);
    return check_summary();
}
