/* A stuck bus: timeouts, recovery by nine clocks and a stop condition, and lines that stay low. */
#include "check.h"
#include "fake_hub.h"

#define FIRST 0x20

static struct fake_hub fake;
static struct fake_sensor sensors[4];

/* Start a hub that streams from this number of boards, run two poll cycles, and forget the recorded line
 * levels. */
static void begin(size_t boards)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, boards);
    CHECK(fake_hub_start(&fake));
    CHECK(fake_hub_run_cycles(&fake, 2));
    fake_hub_forget_frames(&fake);
    fake.line_count = 0;
}

/* Check that counters balance, no frame is missing and no transfers overlapped, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.overlapping, 0);
    CHECK_EQUAL(fake.sequence_gaps, 0);
    fake_hub_free_boards(&fake);
}

/* The result of the next transfers with the second board: an I2C result, or FAKE_HANG. */
static int next_result;

/* End the next transfers with the second board with the result that the test has selected; script of the bus. */
static int spoil_second_board(struct fake_hub *hub, const struct taxel_i2c_transfer *transfer)
{
    if (transfer->address == FIRST + 1 && hub->script_state > 0) {
        hub->script_state--;
        return next_result;
    }
    return FAKE_PROCEED;
}

/* Let the next `transfers` transfers with the second board end with `result`. */
static void inject_failure(int result, int transfers)
{
    next_result = result;
    fake.script_state = transfers;
    fake.script = spoil_second_board;
}

static void a_hanging_transfer_is_aborted(void)
{
    begin(3);
    const uint64_t before = fake.now_us;
    inject_failure(FAKE_HANG, 1);
    CHECK(fake_hub_run_cycles(&fake, 2));
    CHECK_EQUAL(fake.aborts, 1);
    CHECK_BETWEEN(fake.now_us - before, 5000, 25000);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->timeouts, 1);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->last_fault, TAXEL_BOARD_FAULT_TIMEOUT);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_TIMEOUT), 1);
    CHECK_EQUAL(fake.hub.bus_recoveries, 1);
    CHECK(fake_hub_run_cycles(&fake, 2));
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_RECOVERED), 1);
    end();
}

static void a_board_that_always_hangs_does_not_stop_the_others(void)
{
    begin(3);
    inject_failure(FAKE_HANG, 1000000);
    CHECK(fake_hub_run_cycles(&fake, 20));
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->state, TAXEL_BOARD_STATE_ABSENT);
    CHECK_BETWEEN(fake_hub_slot(&fake, FIRST + 1)->timeouts, 19, 20);
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST) >= 19);
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST + 2) >= 19);
    end();
}

/* The timeout stays the same while the hub also handles other events: status frames and bytes from the host. */
static void the_timeout_is_not_extended_by_other_events(void)
{
    for (unsigned events = 0; events < 4; events++) {
        begin(3);
        inject_failure(FAKE_HANG, 1);
        const uint64_t until = fake.now_us + 50000u;
        while (fake.script_state && fake_hub_step(&fake, until)) {
        }
        fake_hub_run(&fake, 500);
        for (unsigned i = 0; i < events; i++) {
            const uint8_t noise = (uint8_t)i;
            fake_hub_receive(&fake, &noise, 1);
        }
        fake_hub_forget_frames(&fake);
        fake_hub_run(&fake, 100000);
        CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->timeouts, 1);
        CHECK(fake_hub_count(&fake, TAXEL_FRAME_TYPE_TAXELS) > 10);
        end();
    }
}

/* Check the levels of SCL and SDA in entry `i` of the recorded line levels. */
static void check_line(size_t i, bool scl, bool sda)
{
    CHECK_EQUAL(fake.lines[i].scl, scl);
    CHECK_EQUAL(fake.lines[i].sda, sda);
}

/* Count clocks, start conditions and stop conditions in the recorded levels of SCL and SDA, as a slave does. If both
 * lines change at the same time, the order is undefined, and the check fails. */
static void read_lines(unsigned *clocks, unsigned *starts, unsigned *stops)
{
    bool scl = true, sda = true;
    *clocks = *starts = *stops = 0;
    for (size_t i = 0; i < fake.line_count; i++) {
        CHECK((fake.lines[i].scl == scl) || (fake.lines[i].sda == sda));
        *clocks += !scl && fake.lines[i].scl;
        *starts += scl && fake.lines[i].scl && sda && !fake.lines[i].sda;
        *stops += scl && fake.lines[i].scl && !sda && fake.lines[i].sda;
        scl = fake.lines[i].scl;
        sda = fake.lines[i].sda;
        if (i) {
            CHECK(fake.lines[i].at_us - fake.lines[i - 1].at_us >= 5 || !i);
        }
    }
    CHECK(scl && sda);
}

static void nine_clocks_and_a_stop_release_sda(void)
{
    for (unsigned low_clocks = 1; low_clocks <= 9; low_clocks++) {
        unsigned clocks, starts, stops;
        begin(2);
        fake.sda_held_clocks = low_clocks;
        while (!fake.line_count && fake_hub_step(&fake, FAKE_NEVER)) {
        }
        check_line(0, true, true);
        for (size_t i = 0; i < low_clocks; i++) {
            check_line(1 + 2 * i, false, true);
            check_line(2 + 2 * i, true, true);
        }
        read_lines(&clocks, &starts, &stops);
        CHECK_EQUAL(clocks, low_clocks + 1u); /* the stop condition needs another rising clock */
        CHECK_EQUAL(starts, 0);
        CHECK_EQUAL(stops, 1);
        CHECK_EQUAL(fake.hub.bus_recoveries, 1);
        const uint32_t lost = fake_hub_slot(&fake, FIRST)->bus_errors + fake_hub_slot(&fake, FIRST + 1)->bus_errors;
        CHECK_EQUAL(lost, 0); /* the poll is repeated */
        CHECK(fake_hub_run_cycles(&fake, 3));
        CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_FAULT), 0);
        end();
    }
}

static void an_sda_that_stays_low_pauses_the_bus(void)
{
    begin(2);
    fake.sda_held_clocks = 200; /* twenty recoveries of ten clocks */
    const uint64_t before = fake.now_us;
    while (fake.sda_held_clocks && fake_hub_step(&fake, before + 1000000u)) {
    }
    CHECK_BETWEEN(fake.now_us - before, 180000, 260000);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_SDA_STUCK) +
                    fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_SDA_STUCK),
                2);
    CHECK(fake_hub_run_cycles(&fake, 4));
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_RECOVERED), 1);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST + 1, TAXEL_BOARD_FAULT_RECOVERED), 1);
    end();
}

static void an_scl_that_stays_low_is_reported(void)
{
    begin(2);
    fake.scl_held = true;
    const uint64_t transfers = fake.transfers;
    fake_hub_run(&fake, 200000);
    CHECK_BETWEEN(fake.transfers - transfers, 10, 40); /* a retry every 10 ms, not continuously */
    for (size_t i = 0; i < fake.line_count; i++) {
        check_line(i, true, true); /* no clock is generated */
    }
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST)->last_fault, TAXEL_BOARD_FAULT_SCL_STUCK);
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_SCL_STUCK), 1);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    fake.scl_held = false;
    CHECK(fake_hub_run_cycles(&fake, 4));
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST)->state, TAXEL_BOARD_STATE_STREAMING);
    end();
}

static void every_result_of_a_transfer_has_its_counter(void)
{
    static const int results[] = {TAXEL_I2C_NACK_ADDRESS, TAXEL_I2C_NACK_DATA, TAXEL_I2C_ARBITRATION_LOST,
                                  TAXEL_I2C_BUS_ERROR,    TAXEL_I2C_TIMEOUT,   FAKE_HANG};
    for (size_t i = 0; i < sizeof results / sizeof results[0]; i++) {
        for (int transfers = 1; transfers < 24; transfers++) {
            begin(2);
            const struct taxel_hub_slot before = *fake_hub_slot(&fake, FIRST + 1);
            inject_failure(results[i], transfers);
            CHECK(fake_hub_run_cycles(&fake, 30));
            const struct taxel_hub_slot after = *fake_hub_slot(&fake, FIRST + 1);
            const uint32_t counted = after.nacks + after.timeouts + after.bus_errors + after.retries;
            CHECK_BETWEEN(counted, transfers / 2, transfers); /* clock readings are not counted */
            CHECK_EQUAL(taxel_hub_polls(&after) - taxel_hub_polls(&before), 30);
            CHECK_EQUAL(after.state, TAXEL_BOARD_STATE_STREAMING);
            CHECK_BETWEEN(taxel_hub_polls(fake_hub_slot(&fake, FIRST)) - fake_hub_slot(&fake, FIRST)->forwarded, 0, 1);
            end();
        }
    }
}

int main(void)
{
    RUN(a_hanging_transfer_is_aborted);
    RUN(a_board_that_always_hangs_does_not_stop_the_others);
    RUN(the_timeout_is_not_extended_by_other_events);
    RUN(nine_clocks_and_a_stop_release_sda);
    RUN(an_sda_that_stays_low_pauses_the_bus);
    RUN(an_scl_that_stays_low_is_reported);
    RUN(every_result_of_a_transfer_has_its_counter);
    return check_summary();
}
