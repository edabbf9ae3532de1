/* The power fails in every write of an update, at every word of the row, and again in every following write: the
 * board always boots, with the old or the new image.
 *
 * test_bootloader_cuts [tears of each second cut [seed]]     default 4; 148: all of them */
#include <stdlib.h>

#include "check.h"
#include "test_bootloader_bench.h"

#define SMALL_ROWS 4u
#define ANY_TEARS 16u /* random repetitions of FAKE_TEAR_ANY */
#define TEARS (4u * (FAKE_FLASH_WORDS + 1u) + ANY_TEARS)
#define OPERATIONS_MAX 120u

static struct bench bench, start, after_first;
static struct bench_image old_image, new_image;
static jmp_buf power;
static unsigned second_tears = 4, bricked, unfinished, resumed;
static uint64_t seed = 20, cuts;
static struct random_source random_tears;

/* Return the power cut number `tear` (0 to TEARS - 1: kind of damage and word) in the flash write number
 * `operation`. */
static struct fake_cut cut_at(unsigned operation, unsigned tear)
{
    const unsigned points = FAKE_FLASH_WORDS + 1u;
    return tear < 4u * points ? (struct fake_cut){operation, (uint8_t)(tear / points), (uint8_t)(tear % points)}
                              : (struct fake_cut){operation, FAKE_TEAR_ANY, 0};
}

/* Return the number of a random kind and position of damage, 0 to TEARS - 1. */
static unsigned random_tear(void)
{
    return (unsigned)(random_u64(&random_tears) % TEARS);
}

/* Switch the board on and let the bootloader start an image. */
static void power_on(void)
{
    bench_reset(&bench, TAXEL_RESET_CAUSE_POWER_ON);
    bench_settle(&bench);
}

/* Return whether the new image is confirmed. */
static bool new_is_confirmed(void)
{
    return taxel_boot_is_confirmed(&bench.config.flash, new_image.slot);
}

/* Confirm the new image, as its application does, if this image is running. */
static void confirm_if_new_runs(void)
{
    if (bench.running == new_image.slot) {
        CHECK_EQUAL(taxel_boot_confirm(&bench.config.flash, new_image.slot), 0);
    }
}

/* Update a board as a host does after its power-up: request the bootloader, write the new image, and let this
 * image confirm itself. */
static void update(void)
{
    bench.confirmed = new_is_confirmed() ? new_image.slot : old_image.slot;
    power_on();
    if (bench.running != new_image.slot) {
        bench.stay_flag = true;
        bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
        CHECK_EQUAL(bench_program(&bench, &new_image), 0);
        bench_settle(&bench);
    }
    confirm_if_new_runs();
}

/* Update a board with one planned power cut. Returns whether the power failed during the update. */
static bool update_with_cut(struct fake_cut cut)
{
    bench.flash.power = &power;
    fake_flash_plan(&bench.flash, cut);
    if (setjmp(power)) {
        cuts++;
        return true;
    }
    update();
    fake_flash_plan(&bench.flash, (struct fake_cut){0});
    return false;
}

/* Return whether the board, switched on now, starts the old or the new image undamaged; counts the board as bricked
 * otherwise. The state of the flash is restored afterwards. */
static bool boots_old_or_new(void)
{
    const struct fake_flash before = bench.flash;
    power_on();
    const bool holds =
        bench.forbidden_writes == 0 && ((bench.running == old_image.slot && bench_holds(&bench, &old_image)) ||
                                        (bench.running == new_image.slot && bench_holds(&bench, &new_image)));
    bricked += !holds;
    bench.flash = before; /* only a check: restores the tries that it used */
    return holds;
}

/* Check that the board starts an image after two power cuts; print the numbers that replay the case after a failure. */
static void check_case(struct fake_cut first, struct fake_cut second)
{
    if (!boots_old_or_new()) {
        CHECK(false);
        printf("  replay: seed %llu, old slot %u, cut 1: write %u tear %u word %u; cut 2: write %u tear %u word %u\n",
               (unsigned long long)seed, old_image.slot, first.operation, first.tear, first.word, second.operation,
               second.tear, second.word);
    }
}

/* Return the number of flash writes in one update without power cuts. */
static unsigned count_operations(void)
{
    bench = start;
    bench.flash.power = &power;
    fake_flash_plan(&bench.flash, (struct fake_cut){0});
    update();
    return bench.flash.operations;
}

/* Repeat the update after a first power cut, with a second power cut at each of the following writes. */
static void cut_following_writes(struct fake_cut first)
{
    after_first = bench;
    for (unsigned operation = 1; operation < OPERATIONS_MAX; operation++) {
        bool was_cut = false;
        for (unsigned i = 0; i < second_tears; i++) {
            bench = after_first;
            const struct fake_cut second = cut_at(operation, second_tears < TEARS ? random_tear() : i);
            was_cut = update_with_cut(second);
            check_case(first, second);
        }
        if (!was_cut) { /* behind the last write: the update was completed */
            power_on();
            unfinished += !bench_holds(&bench, &new_image) || bench.running != new_image.slot || !new_is_confirmed();
            resumed++;
            return;
        }
    }
}

/* Prepare a board with a confirmed old image, and a new image of `rows` rows for the other slot. */
static void prepare(const struct taxel_boot_layout *layout, uint8_t old_slot, unsigned rows)
{
    bench_init(&bench, layout, seed);
    bench_make_image(&old_image, layout, old_slot, rows, 1, seed);
    bench_make_image(&new_image, layout, old_slot ^ 1u, rows, 2, seed + 1u);
    bench_install(&bench, &old_image, true);
    start = bench; /* its pointers point into `bench`, to which it is copied back */
}

/* Interrupt each write of an update at each word in each way, and the writes that follow the cut again; check that the
 * board always starts an image and that the repeated update is completed. */
static void cut_everywhere(const struct taxel_boot_layout *layout, uint8_t old_slot)
{
    prepare(layout, old_slot, SMALL_ROWS);
    const unsigned operations = count_operations();
    CHECK_EQUAL(operations, SMALL_ROWS + 3u); /* rows, pending, first try, confirmed */
    for (unsigned operation = 1; operation <= operations; operation++) {
        for (unsigned tear = 0; tear < TEARS; tear++) {
            const struct fake_cut cut = cut_at(operation, tear);
            bench = start;
            CHECK(update_with_cut(cut));
            check_case(cut, (struct fake_cut){0});
            cut_following_writes(cut);
        }
    }
    CHECK_EQUAL(bricked, 0);
    CHECK_EQUAL(unfinished, 0);
}

static void a_board_that_runs_slot_a_survives_any_cut(void)
{
    cut_everywhere(&taxel_boot_layout_board, 0);
}

static void a_board_that_runs_slot_b_survives_any_cut(void)
{
    cut_everywhere(&taxel_boot_layout_board, 1);
}

static void the_hub_survives_any_cut_over_its_uart(void)
{
    cut_everywhere(&taxel_boot_layout_hub, 0);
}

/* The new image never confirms itself, and the power fails while its tries are recorded. */
static void a_hanging_image_is_abandoned_despite_any_cut(void)
{
    prepare(&taxel_boot_layout_board, 0, SMALL_ROWS);
    bench.stay_flag = true;
    bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    CHECK_EQUAL(bench_program(&bench, &new_image), 0);
    start = bench;
    for (volatile unsigned cut_try = 0; cut_try < TAXEL_BOOT_TRIES - 1u; cut_try++) {
        for (volatile unsigned tear = 0; tear < TEARS; tear++) {
            bench = start;
            bench.flash.power = &power;
            for (volatile unsigned boots = 0; boots < TAXEL_BOOT_TRIES + 1u; boots++) {
                fake_flash_plan(&bench.flash, cut_at(boots == cut_try, tear));
                if (setjmp(power)) {
                    cuts++;
                    bricked += !boots_old_or_new();
                } else {
                    bench_reset(&bench, TAXEL_RESET_CAUSE_WATCHDOG);
                    bench_settle(&bench);
                    CHECK(boots != cut_try);
                }
            }
            CHECK_EQUAL(bench.running, old_image.slot);
            CHECK(bench_holds(&bench, &old_image));
        }
    }
    CHECK_EQUAL(bricked, 0);
}

/* Without an old image, the bootloader must stay accessible. */
static void the_first_image_of_a_blank_board_survives_any_cut(void)
{
    prepare(&taxel_boot_layout_board, 1, SMALL_ROWS);
    bench_init(&bench, &taxel_boot_layout_board, seed);
    start = bench;
    for (volatile unsigned operation = 1; operation <= SMALL_ROWS + 3u; operation++) {
        for (volatile unsigned tear = 0; tear < TEARS; tear++) {
            bench = start;
            bench.flash.power = &power;
            fake_flash_plan(&bench.flash, cut_at(operation, tear));
            if (setjmp(power)) {
                cuts++;
            } else {
                power_on();
                CHECK_EQUAL(bench_program(&bench, &new_image), 0);
                confirm_if_new_runs();
                CHECK(false);
            }
            power_on();
            if (bench.running == BENCH_NO_SLOT) {
                CHECK_EQUAL(bench_program(&bench, &new_image), 0);
            }
            CHECK_EQUAL(bench.running, new_image.slot);
            CHECK(bench_holds(&bench, &new_image));
        }
    }
}

static void images_that_fill_their_slots_survive_any_cut(void)
{
    static const struct {
        const struct taxel_boot_layout *layout;
        unsigned rows;
    } devices[] = {{&taxel_boot_layout_board, 110}, {&taxel_boot_layout_hub, 110}};
    for (unsigned i = 0; i < 2; i++) {
        prepare(devices[i].layout, 0, devices[i].rows);
        const unsigned operations = count_operations();
        CHECK_EQUAL(operations, devices[i].rows + 3u);
        for (unsigned operation = 1; operation <= operations; operation++) {
            const struct fake_cut cut = cut_at(operation, random_tear());
            bench = start;
            CHECK(update_with_cut(cut));
            check_case(cut, (struct fake_cut){0});
        }
        CHECK(!update_with_cut((struct fake_cut){0}));
        CHECK_EQUAL(bench.running, new_image.slot);
        CHECK(bench_holds(&bench, &new_image));
    }
    CHECK_EQUAL(bricked, 0);
}

/* Run the tests (arguments: number of second power cuts per write, 148 for all, and seed) and print the number of power
 * cuts. Exit status 1 after a failure. */
int main(int argc, char **argv)
{
    second_tears = argc > 1 ? (unsigned)strtoul(argv[1], NULL, 0) : second_tears;
    seed = argc > 2 ? strtoull(argv[2], NULL, 0) : seed;
    random_init(&random_tears, seed, 1);
    RUN(a_board_that_runs_slot_a_survives_any_cut);
    RUN(a_board_that_runs_slot_b_survives_any_cut);
    RUN(the_hub_survives_any_cut_over_its_uart);
    RUN(a_hanging_image_is_abandoned_despite_any_cut);
    RUN(the_first_image_of_a_blank_board_survives_any_cut);
    RUN(images_that_fill_their_slots_survive_any_cut);
    printf("%llu cuts, %u bricked; %u updates taken up again, %u unfinished; seed %llu\n", (unsigned long long)cuts,
           bricked, resumed, unfinished, (unsigned long long)seed);
    CHECK(cuts >= 10000);
    return check_summary();
}
