/* Selection of the image to start: confirmed, pending, damaged, hanging, for another device, or none. */
#include "check.h"
#include "codec/crc32.h"
#include "test_bootloader_bench.h"

static struct bench bench;
static struct bench_image image_a, image_b;

/* Prepare a board with erased flash, and one image for each slot that is not in the flash yet. */
static void set_up(void)
{
    bench_init(&bench, &taxel_boot_layout_board, 3);
    bench_make_image(&image_a, &taxel_boot_layout_board, 0, 3, 1, 1);
    bench_make_image(&image_b, &taxel_boot_layout_board, 1, 3, 2, 2);
}

/* Reset the board with this cause. Returns the slot whose image was started, or BENCH_NO_SLOT. */
static uint8_t boot(uint8_t cause)
{
    bench_reset(&bench, cause);
    bench_settle(&bench);
    return bench.running;
}

/* Send a command with one byte of data, or without data if `byte` is negative. Returns the status of the
 * response. */
static unsigned command(uint8_t code, int byte)
{
    const uint8_t data = (uint8_t)byte;
    return bench_send(&bench, code, &data, byte >= 0);
}

/* Prepare a board with a confirmed image in slot A that has just been updated to an image in slot B; this image runs
 * and is not confirmed yet. */
static void update_to_b(void)
{
    set_up();
    bench_install(&bench, &image_a, true);
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    CHECK_EQUAL(bench_program(&bench, &image_b), 0);
    CHECK_EQUAL(bench.running, 1);
}

static void a_hanging_image_is_abandoned_after_three_tries(void)
{
    update_to_b();
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), 1);
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), 1);
    for (unsigned i = 0; i < 10; i++) {
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), 0);
    }
    CHECK_EQUAL(bench.flash.operations, 1u + 3u + 1u + 3u);
    CHECK(!taxel_boot_is_confirmed(&bench.config.flash, 1));
    bench.stay_flag = true; /* the host may flash again */
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    bench_make_image(&image_b, &taxel_boot_layout_board, 1, 3, 3, 4);
    CHECK_EQUAL(bench_program(&bench, &image_b), 0);
    CHECK_EQUAL(bench.running, 1);
}

static void a_confirmed_image_starts_after_every_reset(void)
{
    update_to_b();
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 1), 0);
    const unsigned operations = bench.flash.operations;
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 1), 0);
    for (unsigned i = 0; i < 10; i++) {
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), 1);
    }
    CHECK_EQUAL(bench.flash.operations, operations);
}

static void an_image_may_confirm_itself_on_its_last_try(void)
{
    update_to_b();
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 1);
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 1);
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 1), 0);
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 1);
}

/* The confirmed image in slot B is damaged in its second row. The image in slot A has three tries. */
static void if_the_confirmed_image_is_damaged_the_previous_one_is_tried(void)
{
    update_to_b();
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 1), 0);
    bench.flash.bytes[142u * 128u + 200u] ^= 1u;
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 0);
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), 0);
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), 0);
    /* this image hangs too: the bootloader keeps listening */
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), BENCH_NO_SLOT);
    CHECK_EQUAL(bench.boot.stay, TAXEL_BOOT_STAY_NO_IMAGE);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), 0);
    CHECK_EQUAL(command(TAXEL_BOOT_COMMAND_GET_FLASH_SIZE, 0), 0);
    CHECK_EQUAL(taxel_get_u16(bench.reply), 32);
    bench.confirmed = BENCH_NO_SLOT;
    CHECK_EQUAL(bench_program(&bench, &image_a), 0);
    CHECK_EQUAL(bench.running, 0);
}

static void a_previous_image_that_confirms_itself_starts_after_every_reset(void)
{
    update_to_b();
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 1), 0);
    bench.flash.bytes[142u * 128u + 200u] ^= 1u;
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 0);
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 0), 0);
    for (unsigned i = 0; i < 5; i++) {
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), 0);
    }
}

static void without_an_image_the_bootloader_waits_for_one(void)
{
    set_up();
    for (unsigned i = 0; i < 3; i++) {
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), BENCH_NO_SLOT);
    }
    CHECK_EQUAL(bench.flash.operations, 0);
    CHECK_EQUAL(bench_program(&bench, &image_a), 0);
    CHECK_EQUAL(bench.running, 0);
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 0), 0);
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 0);
}

static void images_without_metadata_are_tried_in_order(void)
{
    set_up();
    bench_install(&bench, &image_a, false);
    bench_install(&bench, &image_b, false);
    for (unsigned i = 0; i < 6; i++) {
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), i < 3u ? 0 : 1);
    }
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_WATCHDOG), BENCH_NO_SLOT);
}

/* First a worn-out flash, whose writes fail, then one whose writes have no effect: the unconfirmed image in slot B is
 * not tried. */
static void a_try_that_cannot_be_recorded_is_not_made(void)
{
    for (unsigned i = 0; i < 2; i++) {
        update_to_b();
        bench.flash.is_worn_out = i == 0;
        bench.flash.is_stuck = i == 1;
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 0);
        CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 1), TAXEL_BOOT_ERROR_FLASH);
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 0);
    }
}

/* Return whether the board starts an image whose header has `value` (of `size` bytes) at `offset`, and a matching
 * CRC. */
static bool starts_with(unsigned offset, uint32_t value, unsigned size)
{
    set_up();
    for (unsigned i = 0; i < size; i++) {
        image_a.bytes[offset + i] = (uint8_t)(value >> (8u * i));
    }
    uint32_t length = taxel_get_u32(image_a.bytes + 12);
    length = length > 32u && length <= BENCH_IMAGE_MAX ? length : 32u;
    taxel_put_u32(image_a.bytes + 28, taxel_crc32(taxel_crc32(0, image_a.bytes, 28), image_a.bytes + 32, length - 32u));
    bench_install(&bench, &image_a, false);
    return boot(TAXEL_RESET_CAUSE_POWER_ON) == 0;
}

static void an_image_with_a_wrong_header_does_not_start(void)
{
    const uint32_t start = 32u * 128u;
    CHECK(starts_with(11, 0, 1));
    CHECK(!starts_with(0, TAXEL_BOOT_IMAGE_MAGIC ^ 1u, 4));
    for (uint32_t value = 0; value < 256; value++) {
        CHECK_EQUAL(starts_with(4, value, 1), value == TAXEL_BOOT_VERSION);
        CHECK_EQUAL(starts_with(5, value, 1), value == TAXEL_BOOT_DEVICE_BOARD);
        CHECK(starts_with(6, value, 1)); /* a board without a configuration accepts any kind */
        CHECK_EQUAL(starts_with(7, value, 1), value == 0);
    }
    /* including the header of 32 bytes, with the vectors behind it */
    for (uint32_t length = 0; length < 48; length++) {
        CHECK_EQUAL(starts_with(12, length, 4), length >= 40u && length % 4u == 0);
    }
    CHECK(starts_with(12, 14080, 4));
    CHECK(!starts_with(12, 14084, 4));
    CHECK(!starts_with(12, 0xFFFFFFFCu, 4));
    for (uint32_t vectors = start; vectors < start + 400u; vectors++) {
        set_up();
        const uint32_t last = start + image_a.size - 12u - 8u;
        const bool is_valid = vectors >= start + 32u && vectors <= last && vectors % 4u == 0;
        CHECK_EQUAL(starts_with(16, vectors, 4) || bench.boot.started, is_valid);
    }
    CHECK(!starts_with(16, 0xFFFFFFFCu, 4));
}

static void an_image_with_a_flipped_bit_does_not_start(void)
{
    set_up();
    const unsigned length = taxel_get_u32(image_a.bytes + 12);
    for (unsigned bit = 0; bit < 8u * length; bit++) {
        set_up();
        image_a.bytes[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        bench_install(&bench, &image_a, true);
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), BENCH_NO_SLOT);
    }
}

static void after_an_uncommanded_reset_the_bootloader_listens_first(void)
{
    static const struct {
        uint8_t cause;
        bool listens;
    } causes[] = {{TAXEL_RESET_CAUSE_POWER_ON, true},
                  {TAXEL_RESET_CAUSE_BROWN_OUT, true},
                  {TAXEL_RESET_CAUSE_WATCHDOG, true},
                  {TAXEL_RESET_CAUSE_COMMAND, false}};
    for (unsigned i = 0; i < sizeof causes / sizeof causes[0]; i++) {
        set_up();
        bench_install(&bench, &image_a, true);
        bench_reset(&bench, causes[i].cause);
        CHECK_EQUAL(bench.running, causes[i].listens ? BENCH_NO_SLOT : 0);
        bench.clock_us += TAXEL_BOOT_LISTEN_US - 1u;
        bench_run(&bench);
        CHECK_EQUAL(bench.running, causes[i].listens ? BENCH_NO_SLOT : 0);
        if (causes[i].listens) {
            CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), 0);
            bench_settle(&bench);
            CHECK_EQUAL(bench.running, BENCH_NO_SLOT);
            CHECK_EQUAL(bench.boot.stay, TAXEL_BOOT_STAY_HOST);
        }
    }
}

static void a_bootloader_request_applies_to_one_reset(void)
{
    set_up();
    bench_install(&bench, &image_a, true);
    bench.stay_flag = true;
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_COMMAND), BENCH_NO_SLOT);
    CHECK_EQUAL(bench.boot.stay, TAXEL_BOOT_STAY_REQUESTED);
    CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_COMMAND), 0);
}

/* Write metadata records with sequence numbers in both rows, in either order, also across the wrap of the numbers; the
 * later record confirms slot B. */
static void the_later_of_two_records_is_the_newest(void)
{
    static const uint32_t sequences[][2] = {{1, 2}, {0x7FFFFFFF, 0x80000000u}, {0xFFFFFFFFu, 0}, {0xFFFFFFFEu, 1}};
    for (unsigned i = 0; i < 8; i++) {
        set_up();
        bench_install(&bench, &image_a, false);
        bench_install(&bench, &image_b, false);
        for (unsigned row = 0; row < 2; row++) { /* the earlier record confirms A, the later one B */
            struct taxel_boot_record record = {.magic = TAXEL_BOOT_METADATA_MAGIC, .sequence = sequences[i / 2][row]};
            const struct taxel_boot_metadata metadata = {(uint8_t)row, TAXEL_BOOT_SLOT_NONE, {3, 3}};
            uint8_t *const bytes = bench.flash.bytes + (TAXEL_BOOT_METADATA_ROW + (row ^ (i & 1u))) * 128u;
            taxel_boot_metadata_pack(&metadata, record.payload);
            taxel_boot_record_pack(&record, bytes);
            taxel_put_u32(bytes + TAXEL_BOOT_RECORD_OFFSET_CRC32,
                          taxel_crc32(0, bytes, TAXEL_BOOT_RECORD_OFFSET_CRC32));
        }
        CHECK_EQUAL(boot(TAXEL_RESET_CAUSE_POWER_ON), 1);
    }
}

static void metadata_writes_alternate_between_both_rows(void)
{
    set_up();
    bench_install(&bench, &image_a, true);
    bench_install(&bench, &image_b, false);
    for (unsigned i = 0; i < 1000; i++) {
        CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, i & 1u ? 0 : 1), 0);
    }
    CHECK_BETWEEN(bench.flash.wear[TAXEL_BOOT_METADATA_ROW], 500, 501);
    CHECK_BETWEEN(bench.flash.wear[TAXEL_BOOT_METADATA_ROW + 1u], 500, 501);
    CHECK_EQUAL(bench.flash.zero_sums, 0);
}

int main(void)
{
    RUN(a_hanging_image_is_abandoned_after_three_tries);
    RUN(a_confirmed_image_starts_after_every_reset);
    RUN(an_image_may_confirm_itself_on_its_last_try);
    RUN(if_the_confirmed_image_is_damaged_the_previous_one_is_tried);
    RUN(a_previous_image_that_confirms_itself_starts_after_every_reset);
    RUN(without_an_image_the_bootloader_waits_for_one);
    RUN(images_without_metadata_are_tried_in_order);
    RUN(a_try_that_cannot_be_recorded_is_not_made);
    RUN(an_image_with_a_wrong_header_does_not_start);
    RUN(an_image_with_a_flipped_bit_does_not_start);
    RUN(after_an_uncommanded_reset_the_bootloader_listens_first);
    RUN(a_bootloader_request_applies_to_one_reset);
    RUN(the_later_of_two_records_is_the_newest);
    RUN(metadata_writes_alternate_between_both_rows);
    return check_summary();
}
