/* The star of branches: rise times against the formula of the I2C specification, levels with line faults, and the bus
 * of an emulated world with a branch that is slow, open or shorted. */
#include <math.h>
#include <stdlib.h>

#include "check.h"
#include "fake_world.h"

#define BOARDS 4 /* 0x22 and 0x23 in the branch `index`, 0x20 and 0x21 in the branch `middle` */
#define INDEX 0x22
#define MIDDLE 0x20
#define RISE_FACTOR 0.8472978604 /* ln(7 / 3) */

static struct fake_world fake;
static const struct line_fault healthy[WIRING_BRANCHES_MAX];

/* Return a wiring of two branches with these pull-ups and capacitances, and a hub without a pull-up. */
static struct wiring_description make_wiring(double ohm, double picofarad)
{
    struct wiring_description wiring = {.hub_capacitance_pf = 10.0, .branch_count = 2};
    for (size_t i = 0; i < 2; i++) {
        wiring.branches[i] =
            (struct branch_description){.name = {i ? 'm' : 'i'}, .pullup_ohm = ohm, .capacitance_pf = picofarad};
    }
    for (uint8_t i = 0; i < BOARDS; i++) {
        wiring.branch_of[0x20 + i] = i < 2 ? 2 : 1;
    }
    return wiring;
}

static void rise_time_without_series_resistance_is_that_of_the_specification(void)
{
    const struct wiring_description wiring = make_wiring(2200.0, 100.0);
    struct star star;
    star_solve(&star, &wiring, healthy);
    const double expected_s = RISE_FACTOR * 1100.0 * 210e-12;
    CHECK(fabs(star.hub_rise_s / expected_s - 1.0) < 1e-3);
    CHECK(fabs(star.branches[0].rise_s / expected_s - 1.0) < 1e-3);
    CHECK(star.is_high && star.can_be_low);
    CHECK(star.branches[1].is_high && star.branches[1].hub_lows_arrive && star.branches[1].board_lows_arrive);
}

static void rise_time_of_a_buffered_branch_depends_on_that_branch_only(void)
{
    struct wiring_description wiring = make_wiring(2200.0, 50.0);
    struct star star;
    wiring.is_buffered = true;
    wiring.hub_pullup_ohm = 4700.0;
    wiring.branches[0].capacitance_pf = 400.0;
    star_solve(&star, &wiring, healthy);
    CHECK(fabs(star.branches[0].rise_s / (RISE_FACTOR * 2200.0 * 400e-12) - 1.0) < 1e-3);
    CHECK(fabs(star.branches[1].rise_s / (RISE_FACTOR * 2200.0 * 50e-12) - 1.0) < 1e-3);
    CHECK(fabs(star.hub_rise_s / (RISE_FACTOR * 4700.0 * 10e-12) - 1.0) < 1e-3);
}

static void series_resistance_slows_the_boards_behind_it(void)
{
    struct wiring_description wiring = make_wiring(0.0, 100.0);
    struct star star;
    wiring.hub_pullup_ohm = 1000.0;
    wiring.branches[0].series_ohm = 200.0; /* the level at the hub: 333 / 1333 of the supply */
    star_solve(&star, &wiring, healthy);
    CHECK(star.branches[0].rise_s > star.hub_rise_s);
    CHECK(star.branches[0].hub_lows_arrive && star.branches[0].board_lows_arrive);
    wiring.branches[0].series_ohm = 10000.0; /* the level at the hub: (10000 + 133) / 11133 of the supply */
    star_solve(&star, &wiring, healthy);
    CHECK(!star.branches[0].board_lows_arrive && star.branches[1].board_lows_arrive);
}

static void line_without_pullup_stays_low(void)
{
    const struct wiring_description wiring = make_wiring(0.0, 100.0);
    struct star star;
    star_solve(&star, &wiring, healthy);
    CHECK(!star.is_high && isinf(star.hub_rise_s));
}

static void short_to_ground_holds_a_passive_star_low_and_one_branch_of_a_buffered_star(void)
{
    struct wiring_description wiring = make_wiring(2200.0, 100.0);
    const struct line_fault faults[WIRING_BRANCHES_MAX] = {{.has_short_to_ground = true}};
    struct star star;
    star_solve(&star, &wiring, faults);
    CHECK(!star.is_high && !star.branches[1].is_high);
    wiring.is_buffered = true;
    wiring.hub_pullup_ohm = 4700.0;
    star_solve(&star, &wiring, faults);
    CHECK(star.is_high && !star.branches[0].is_high && star.branches[1].is_high);
}

static void short_to_supply_keeps_a_passive_star_high(void)
{
    const struct wiring_description wiring = make_wiring(2200.0, 100.0);
    const struct line_fault faults[WIRING_BRANCHES_MAX] = {{.has_short_to_supply = true}};
    struct star star;
    star_solve(&star, &wiring, faults);
    CHECK(star.is_high && !star.can_be_low);
}

static void open_branch_takes_its_pullup_and_capacitance_away(void)
{
    const struct wiring_description wiring = make_wiring(2200.0, 100.0);
    const struct line_fault faults[WIRING_BRANCHES_MAX] = {{.is_open = true}};
    struct star star;
    star_solve(&star, &wiring, faults);
    CHECK(fabs(star.hub_rise_s / (RISE_FACTOR * 2200.0 * 110e-12) - 1.0) < 1e-3);
    CHECK(!star.branches[0].hub_lows_arrive && !star.branches[0].board_lows_arrive);
}

/* At 400 kHz the limit is 300 ns and the set-up time 100 ns, so 10 ns above the limit give a probability of 0.1. */
static void misread_probability_follows_the_limits_of_the_modes(void)
{
    CHECK(star_misread_probability(300e-9, 400e3) == 0.0);
    CHECK(fabs(star_misread_probability(310e-9, 400e3) - 0.1) < 1e-9);
    CHECK(star_misread_probability(500e-9, 400e3) == 1.0);
    CHECK(star_misread_probability(500e-9, 100e3) == 0.0);
    CHECK(star_misread_probability(1000e-9, 100e3) == 0.0);
    CHECK(star_misread_probability(121e-9, 1e6) > 0.0);
    CHECK(star_rise_limit_s(2e6) < star_rise_limit_s(1e6));
}

/* Open the described world, start the stream and run for `seconds`. */
static void run_world(double seconds)
{
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, seconds), 0);
}

/* Describe a world of four boards in two branches. */
static void describe_world(struct wiring_description wiring, double scl_hz)
{
    fake_world_describe(&fake, BOARDS, 40);
    fake.description.scl_hz = scl_hz;
    fake.description.wiring = wiring;
}

/* Return the number of failed polls of a board. */
static unsigned failed_polls(uint8_t address)
{
    const struct taxel_hub_slot *slot = fake_world_slot(&fake, address);
    return slot->nacks + slot->crc_errors + slot->timeouts;
}

static void wiring_within_the_limit_does_not_change_a_byte(void)
{
    uint32_t crc[2];
    for (unsigned i = 0; i < 2; i++) {
        describe_world(i ? make_wiring(2200.0, 100.0) : (struct wiring_description){.branch_count = 0}, 400e3);
        run_world(1.0);
        crc[i] = fake.stream_crc;
        fake_world_close(&fake);
    }
    CHECK_EQUAL(crc[0], crc[1]);
}

static void slow_branch_fails_at_400_khz_and_works_at_100_khz(void)
{
    struct wiring_description wiring = make_wiring(2200.0, 60.0);
    wiring.is_buffered = true;
    wiring.hub_pullup_ohm = 4700.0;
    wiring.branches[0].capacitance_pf = 170.0; /* 317 ns: above 300 ns, below 1000 ns */
    describe_world(wiring, 400e3);
    run_world(1.0);
    CHECK(fake.world.bus.wiring.misread_bits[1] > 0);
    CHECK_EQUAL(fake.world.bus.wiring.misread_bits[2], 0);
    CHECK(failed_polls(INDEX) > 0);
    CHECK_EQUAL(failed_polls(MIDDLE), 0); /* its addresses have fewer ones, so that no board misreads them as its own */
    CHECK_EQUAL(fake.bad_board_crcs, 0);
    fake_world_close(&fake);
    describe_world(wiring, 100e3);
    run_world(1.0);
    CHECK_EQUAL(fake.world.bus.wiring.misread_bits[1], 0);
    CHECK_EQUAL(failed_polls(INDEX), 0);
    CHECK(fake.frames_of[INDEX] > 20 && fake.frames_of[MIDDLE] > 20);
    fake_world_close(&fake);
}

/* Run the world for `seconds`. Returns the number of frames of a board in this time. */
static unsigned frames_during(uint8_t address, double seconds)
{
    const unsigned before = fake.frames_of[address];
    CHECK_EQUAL(fake_world_run(&fake, seconds), 0);
    return fake.frames_of[address] - before;
}

/* Inject a fault of the branch `index` and let the hub detect it. */
static void inject(enum fault_kind kind, double selection, double ohm)
{
    const struct fault_description fault = {.kind = kind, .address = INDEX, .value = selection, .second_value = ohm};
    CHECK_EQUAL(world_inject_fault(&fake.world, &fault), 0);
    CHECK_EQUAL(fake_world_run(&fake, 0.2), 0);
}

static void boards_of_a_faulty_branch_stop_together_and_return(void)
{
    static const struct {
        enum fault_kind kind;
        double selection, ohm;
        bool stops_all; /* in a passive star */
    } cases[] = {
        {FAULT_BRANCH_OPEN, 0, 0, false},         {FAULT_BRANCH_OPEN, 1, 0, false},
        {FAULT_BRANCH_OPEN, 2, 0, false},         {FAULT_BRANCH_OPEN, 3, 0, false},
        {FAULT_BRANCH_RESISTANCE, 0, 5e3, false}, {FAULT_BRANCH_SHORT_GROUND, 1, 0, true},
        {FAULT_BRANCH_SHORT_GROUND, 2, 0, true},  {FAULT_BRANCH_SHORT_SUPPLY, 1, 0, true},
        {FAULT_BRANCH_SHORT_SUPPLY, 2, 0, true},
    };
    for (size_t i = 0; i < 2u * sizeof cases / sizeof cases[0]; i++) {
        const size_t n = i / 2u;
        struct wiring_description wiring = make_wiring(2200.0, 50.0);
        wiring.hub_pullup_ohm = 2200.0;
        wiring.is_buffered = i & 1u;
        describe_world(wiring, 400e3);
        run_world(0.5);
        inject(cases[n].kind, cases[n].selection, cases[n].ohm);
        const bool stops_all = cases[n].stops_all && !wiring.is_buffered;
        const unsigned middle = fake.frames_of[MIDDLE];
        CHECK_EQUAL(frames_during(INDEX, 0.5), 0);
        CHECK(stops_all ? fake.frames_of[MIDDLE] == middle : fake.frames_of[MIDDLE] > middle + 20);
        inject(FAULT_BRANCH_RESTORE, 0, 0);
        CHECK_EQUAL(fake_world_run(&fake, 1.5), 0);
        CHECK(frames_during(INDEX, 0.5) > 20);
        CHECK(frames_during(INDEX + 1, 0.5) > 20);
        CHECK(fake_world_adds_up(&fake));
        CHECK_EQUAL(fake.bad_board_crcs, 0);
        fake_world_close(&fake);
    }
}

static void plugged_board_stays_off_while_the_supply_of_its_branch_is_open(void)
{
    const struct fault_description plug = {.kind = FAULT_PLUG, .address = INDEX};
    describe_world(make_wiring(2200.0, 50.0), 400e3);
    run_world(0.3);
    inject(FAULT_BRANCH_OPEN, 3, 0);
    CHECK_EQUAL(world_inject_fault(&fake.world, &plug), 0);
    CHECK(!fake.world.boards[INDEX - 0x20].is_powered);
    inject(FAULT_BRANCH_RESTORE, 0, 0);
    CHECK(fake.world.boards[INDEX - 0x20].is_powered);
    fake_world_close(&fake);
}

static void fault_of_an_unknown_branch_or_line_is_rejected(void)
{
    const struct fault_description unknown = {.kind = FAULT_BRANCH_OPEN, .address = 0x50};
    const struct fault_description line = {.kind = FAULT_BRANCH_SHORT_GROUND, .address = INDEX, .value = 0};
    describe_world(make_wiring(2200.0, 50.0), 400e3);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK_EQUAL(world_inject_fault(&fake.world, &unknown), -1);
    CHECK_EQUAL(world_inject_fault(&fake.world, &line), -1);
    fake_world_close(&fake);
}

int main(void)
{
    RUN(rise_time_without_series_resistance_is_that_of_the_specification);
    RUN(rise_time_of_a_buffered_branch_depends_on_that_branch_only);
    RUN(series_resistance_slows_the_boards_behind_it);
    RUN(line_without_pullup_stays_low);
    RUN(short_to_ground_holds_a_passive_star_low_and_one_branch_of_a_buffered_star);
    RUN(short_to_supply_keeps_a_passive_star_high);
    RUN(open_branch_takes_its_pullup_and_capacitance_away);
    RUN(misread_probability_follows_the_limits_of_the_modes);
    RUN(wiring_within_the_limit_does_not_change_a_byte);
    RUN(slow_branch_fails_at_400_khz_and_works_at_100_khz);
    RUN(boards_of_a_faulty_branch_stop_together_and_return);
    RUN(plugged_board_stays_off_while_the_supply_of_its_branch_is_open);
    RUN(fault_of_an_unknown_branch_or_line_is_rejected);
    return check_summary();
}
