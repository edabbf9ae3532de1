/* The bootloader of a part with one slot: an update overwrites the only image. The power fails in every write of the
 * update; the board then runs a complete image that was verified, or waits in its bootloader for the host.
 *
 * test_bootloader_one_slot [seed]     default 20 */
#include <stdlib.h>

#include "check.h"
#include "test_bootloader_bench.h"

#define SMALL_ROWS 4u
#define WRITES (SMALL_ROWS + 4u) /* no image may start, rows, pending, first try, confirmed */
#define TEARS (FAKE_TEAR_COUNT * (FAKE_FLASH_WORDS + 1u))

static const struct taxel_boot_layout *const layout = &taxel_boot_layout_board_16k;
static struct bench bench, start;
static struct bench_image old_image, new_image;
static jmp_buf power;
static uint64_t seed = 20;

/* Prepare a board with a confirmed old image, and a new image for the same slot. */
static void prepare(unsigned rows)
{
    bench_init(&bench, layout, seed);
    bench_make_image(&old_image, layout, 0, rows, 1, seed);
    bench_make_image(&new_image, layout, 0, rows, 2, seed + 1u);
    bench_install(&bench, &old_image, true);
    bench.confirmed = BENCH_NO_SLOT; /* the host may write the only slot */
    start = bench;
}

static void power_on(void)
{
    bench_reset(&bench, TAXEL_RESET_CAUSE_POWER_ON);
    bench_settle(&bench);
}

/* Request the bootloader and write the new image. Returns the first status that is not OK, or OK. */
static unsigned write_new_image(void)
{
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    return bench_program(&bench, &new_image);
}

/* Update the board, and confirm the new image as its application does. */
static void update(void)
{
    CHECK_EQUAL(write_new_image(), 0);
    bench_settle(&bench);
    CHECK_EQUAL(bench.running, 0);
    CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, 0), 0);
}

static void an_update_replaces_the_only_image(void)
{
    prepare(layout->slot_rows);
    power_on();
    CHECK_EQUAL(bench.running, 0);
    bench.flash.power = &power;
    fake_flash_plan(&bench.flash, (struct fake_cut){0});
    update();
    CHECK_EQUAL(bench.flash.operations, layout->slot_rows + 4u);
    power_on();
    CHECK_EQUAL(bench.running, 0);
    CHECK(bench_holds(&bench, &new_image) && taxel_boot_is_confirmed(&bench.config.flash, 0));
    CHECK_EQUAL(bench.forbidden_writes, 0);
}

static void the_reports_name_slot_a_and_no_kept_slot(void)
{
    const uint8_t slot_a = 0, slot_b = 1;
    prepare(SMALL_ROWS);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), 0);
    CHECK_EQUAL(taxel_get_u32(bench.reply), TAXEL_BOOT_SILICON_ID);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_FLASH_SIZE, &slot_a, 1), 0);
    CHECK_EQUAL(taxel_get_u16(bench.reply), 32);
    CHECK_EQUAL(taxel_get_u16(bench.reply + 2), 123);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0), 0);
    CHECK_EQUAL(bench.reply[TAXEL_BOOT_INFO_OFFSET_DEVICE], TAXEL_BOOT_DEVICE_BOARD_16K);
    CHECK_EQUAL(bench.reply[TAXEL_BOOT_INFO_OFFSET_TARGET], 0);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_APPLICATION_STATUS, &slot_a, 1), 0);
    CHECK_EQUAL(bench.reply[0], 0); /* bootable */
    CHECK_EQUAL(bench.reply[1], 0); /* not kept */
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_APPLICATION_STATUS, &slot_b, 1),
                TAXEL_BOOT_STATUS_APPLICATION);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_SET_ACTIVE, &slot_b, 1), TAXEL_BOOT_STATUS_APPLICATION);
}

static void only_rows_of_the_slot_can_be_written(void)
{
    prepare(SMALL_ROWS);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), 0);
    for (unsigned row = 0; row < 300u; row++) {
        const uint8_t address[] = {0, (uint8_t)row, (uint8_t)(row >> 8)};
        const unsigned expected = row >= 128u                ? TAXEL_BOOT_STATUS_ROW
                                  : row < 32u || row >= 124u ? TAXEL_BOOT_STATUS_ROW_PROTECTED
                                                             : TAXEL_BOOT_STATUS_OK;
        CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ERASE_ROW, address, sizeof address), expected);
    }
    CHECK_EQUAL(bench.forbidden_writes, 0);
    power_on();
    CHECK_EQUAL(bench.running, BENCH_NO_SLOT);
}

static void a_complete_image_without_verification_does_not_start(void)
{
    prepare(SMALL_ROWS);
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0), 0);
    for (unsigned i = 0; i < SMALL_ROWS; i++) {
        CHECK_EQUAL(bench_program_row(&bench, (uint16_t)(32u + i), new_image.bytes + i * TAXEL_BOOT_ROW_SIZE), 0);
    }
    power_on();
    CHECK_EQUAL(bench.running, BENCH_NO_SLOT);
    CHECK_EQUAL(bench_program(&bench, &new_image), 0); /* a host repeats the update */
    CHECK_EQUAL(bench.running, 0);
}

static void an_image_that_never_confirms_itself_ends_in_the_bootloader(void)
{
    prepare(SMALL_ROWS);
    CHECK_EQUAL(write_new_image(), 0);
    for (unsigned boots = 1; boots < TAXEL_BOOT_TRIES; boots++) { /* the exit of the update used the first try */
        bench_reset(&bench, TAXEL_RESET_CAUSE_WATCHDOG);
        bench_settle(&bench);
        CHECK_EQUAL(bench.running, 0);
    }
    bench_reset(&bench, TAXEL_RESET_CAUSE_WATCHDOG);
    bench_settle(&bench);
    CHECK_EQUAL(bench.running, BENCH_NO_SLOT);
    CHECK_EQUAL(bench_send(&bench, TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0), 0);
    CHECK_EQUAL(bench.reply[TAXEL_BOOT_INFO_OFFSET_STAY], TAXEL_BOOT_STAY_NO_IMAGE);
    CHECK_EQUAL(bench_program(&bench, &old_image), 0);
    CHECK_EQUAL(bench.running, 0);
}

/* Cut the power in one write of the update and switch the board on again. Returns whether the power failed. */
static bool update_with_cut(struct fake_cut cut)
{
    bench = start;
    bench.flash.power = &power;
    fake_flash_plan(&bench.flash, cut);
    if (setjmp(power)) {
        power_on();
        return true;
    }
    update();
    return false;
}

static void after_any_cut_a_verified_image_runs_or_the_bootloader_waits(void)
{
    prepare(SMALL_ROWS);
    for (volatile unsigned operation = 1; operation <= WRITES; operation++) {
        for (volatile unsigned tear = 0; tear < TEARS; tear++) {
            const struct fake_cut cut = {operation, (uint8_t)(tear / (FAKE_FLASH_WORDS + 1u)),
                                         (uint8_t)(tear % (FAKE_FLASH_WORDS + 1u))};
            CHECK(update_with_cut(cut));
            if (operation == 1u) { /* the old image may still start, it is complete */
                CHECK(bench.running == BENCH_NO_SLOT || bench_holds(&bench, &old_image));
            } else if (operation <= 1u + SMALL_ROWS) {
                CHECK_EQUAL(bench.running, BENCH_NO_SLOT);
            } else { /* the rows are complete; whether the record is, depends on the cut */
                CHECK(bench_holds(&bench, &new_image));
            }
            fake_flash_plan(&bench.flash, (struct fake_cut){0});
            update();
            power_on();
            if (!CHECK_EQUAL(bench.running, 0) || !CHECK(bench_holds(&bench, &new_image))) {
                printf("  replay: seed %llu, write %u tear %u word %u\n", (unsigned long long)seed, operation, cut.tear,
                       cut.word);
            }
        }
    }
    CHECK_EQUAL(bench.forbidden_writes, 0);
}

int main(int count, char **arguments)
{
    seed = count > 1 ? strtoull(arguments[1], NULL, 0) : seed;
    printf("seed %llu\n", (unsigned long long)seed);
    RUN(an_update_replaces_the_only_image);
    RUN(the_reports_name_slot_a_and_no_kept_slot);
    RUN(only_rows_of_the_slot_can_be_written);
    RUN(a_complete_image_without_verification_does_not_start);
    RUN(an_image_that_never_confirms_itself_ends_in_the_bootloader);
    RUN(after_any_cut_a_verified_image_runs_or_the_bootloader_waits);
    return check_summary();
}
