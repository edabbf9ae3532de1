/* The scan sequencer: order, numbering, stop and start, new settings at the next scan. */
#include "check.h"
#include "codec/crc32.h"
#include "fake_sensor.h"

static struct fake_sensor fake;
static uint8_t snapshot[TAXEL_SNAPSHOT_SIZE(TAXEL_TAXELS_MAX)];

/* Start a simulated board with this number of TX and RX lines. The last of every `skip` crossings has no taxel (0:
 * all crossings have one). */
static void boot(uint8_t rows, uint8_t columns, unsigned skip)
{
    fake_sensor_init(&fake, 0x21, rows, columns, skip);
    CHECK_EQUAL(fake_sensor_boot(&fake), 0);
}

/* Read a snapshot of the board. Returns its header; the bytes are in `snapshot`. */
static struct taxel_snapshot_header read_snapshot(void)
{
    struct taxel_snapshot_header header = {0};
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT, snapshot, TAXEL_SNAPSHOT_SIZE(fake.config.taxel_count)));
    taxel_snapshot_header_unpack(&header, snapshot);
    return header;
}

static void the_scan_goes_tx_by_tx_over_the_taxels(void)
{
    boot(5, 7, 3);
    fake_scan(&fake, 2);
    unsigned conversion = 0;
    for (unsigned scan = 0; scan < 2; scan++) {
        for (uint8_t tx = 0; tx < 5; tx++) {
            for (uint8_t rx = 0; rx < 7; rx++) {
                const unsigned crossing = tx * 7u + rx;
                if (fake.crossing_map[crossing >> 3] & (1u << (crossing & 7u))) {
                    CHECK_EQUAL(fake.history[conversion][0], tx);
                    CHECK_EQUAL(fake.history[conversion][1], rx);
                    conversion++;
                }
            }
        }
    }
    CHECK_EQUAL(conversion, 2u * fake.config.taxel_count);
    CHECK_EQUAL(fake.overlapping, 0);
    fake_sensor_free(&fake);
}

static void the_snapshot_crc_covers_the_address(void)
{
    boot(3, 5, 4);
    fake_scan(&fake, 1);
    (void)read_snapshot();
    CHECK(fake_snapshot_is_valid(&fake, snapshot));
    const size_t size = TAXEL_SNAPSHOT_SIZE(fake.config.taxel_count);
    CHECK(taxel_crc32(0, snapshot, size - 4u) != taxel_get_u32(snapshot + size - 4u));
    const uint8_t other = 0x22;
    CHECK(taxel_crc32(taxel_crc32(0, &other, 1), snapshot, size - 4u) != taxel_get_u32(snapshot + size - 4u));
    fake_sensor_free(&fake);
}

static void sequence_and_timestamp_are_set_at_the_start_of_a_scan(void)
{
    boot(2, 2, 0);
    for (uint16_t scan = 0; scan < 5; scan++) {
        fake_scan(&fake, 1);
        const struct taxel_snapshot_header header = read_snapshot();
        CHECK_EQUAL(header.sequence, scan);
        CHECK_EQUAL(header.timestamp_us, scan * 4u * 10u);
    }
    CHECK_EQUAL(fake_status(&fake).scans, 5);
    CHECK_EQUAL(fake_status(&fake).scan_time_us, 40);
    fake_sensor_free(&fake);
}

static void sequence_and_clock_wrap(void)
{
    fake_sensor_init(&fake, 0x21, 1, 1, 0);
    fake.clock_us = 0xFFFFFFF0u - 65535u * 10u;
    CHECK_EQUAL(fake_sensor_boot(&fake), 0);
    fake_scan(&fake, 0x10000u);
    struct taxel_snapshot_header header = read_snapshot();
    CHECK_EQUAL(header.sequence, 0xFFFF);
    CHECK_EQUAL(header.timestamp_us, 0xFFFFFFF0u);
    fake_scan(&fake, 2);
    header = read_snapshot();
    CHECK_EQUAL(header.sequence, 1);
    CHECK_EQUAL(header.timestamp_us, 4); /* 20 us after 0xFFFFFFF0 */
    CHECK(fake_snapshot_is_valid(&fake, snapshot));
    CHECK_EQUAL(fake_status(&fake).scans, 0x10002);
    CHECK_EQUAL(fake_status(&fake).scan_time_us, 10);
    fake_sensor_free(&fake);
}

static void a_stopped_scan_is_discarded(void)
{
    boot(2, 3, 0);
    fake_scan(&fake, 1);
    fake_convert(&fake, 3);
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_STOP_SCAN));
    CHECK_EQUAL(fake_status(&fake).state, TAXEL_SENSOR_STOPPED);
    fake_convert(&fake, 100);
    CHECK(!fake.converting);
    CHECK_EQUAL(fake.started, 6u + 3u + 1u);
    CHECK_EQUAL(read_snapshot().sequence, 0);
    CHECK(fake_snapshot_is_valid(&fake, snapshot));
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_START_SCAN));
    fake_scan(&fake, 1);
    CHECK_EQUAL(read_snapshot().sequence, 1);
    CHECK(fake_snapshot_is_valid(&fake, snapshot));
    fake_sensor_free(&fake);
}

/* Send each sequence of four stop and start commands during one conversion, at each position of the scan. */
static void stop_and_start_work_during_a_conversion(void)
{
    for (unsigned position = 0; position < 7; position++) {
        for (unsigned pattern = 0; pattern < 16; pattern++) {
            boot(2, 3, 0);
            fake_convert(&fake, position);
            bool scanning = true;
            for (unsigned i = 0; i < 4; i++) {
                scanning = (pattern >> i) & 1u;
                CHECK(fake_command(&fake, scanning ? TAXEL_BOARD_COMMAND_START_SCAN : TAXEL_BOARD_COMMAND_STOP_SCAN));
            }
            fake_convert(&fake, 20);
            CHECK_EQUAL(fake.converting, scanning);
            CHECK_EQUAL(fake.overlapping, 0);
            CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_START_SCAN));
            fake_convert(&fake, 20);
            (void)read_snapshot();
            CHECK(fake_snapshot_is_valid(&fake, snapshot));
            CHECK_EQUAL(fake.overlapping, 0);
            fake_sensor_free(&fake);
        }
    }
}

static void settings_take_effect_with_the_next_scan(void)
{
    const struct taxel_scan_settings settings = {100, 20, 2, 8, 50};
    boot(2, 3, 0);
    fake_convert(&fake, 2);
    CHECK(fake_write_settings(&fake, &settings));
    CHECK_EQUAL(fake.configured, 1);
    CHECK_EQUAL(fake_status(&fake).settings_generation, 0);
    fake_convert(&fake, 3);
    CHECK_EQUAL(fake.configured, 1);
    fake_convert(&fake, 1);
    CHECK_EQUAL(fake.configured, 2);
    CHECK_EQUAL(fake.front_end.sub_conversions, 100);
    CHECK_EQUAL(fake.front_end.settle_cycles, 50);
    CHECK_EQUAL(fake_status(&fake).settings_generation, 1);
    fake_scan(&fake, 3);
    CHECK_EQUAL(fake.configured, 2);
    CHECK_EQUAL(fake.configured_while_converting, 0);
    fake_sensor_free(&fake);
}

static void settings_of_a_stopped_board_take_effect_at_the_start(void)
{
    const struct taxel_scan_settings settings = {100, 20, 2, 8, 50};
    boot(2, 3, 0);
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_STOP_SCAN));
    CHECK(fake_write_settings(&fake, &settings));
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_START_SCAN));
    CHECK_EQUAL(fake.configured, 1);
    fake_convert(&fake, 1);
    CHECK_EQUAL(fake.configured, 2);
    CHECK_EQUAL(fake.configured_while_converting, 0);
    fake_sensor_free(&fake);
}

/* Return the raw count of a saturated conversion: 0. */
static uint16_t always_zero(struct fake_sensor *sensor)
{
    (void)sensor;
    return 0;
}

static void saturated_conversions_are_counted_and_the_counter_saturates(void)
{
    boot(1, 2, 0);
    fake.count_of = always_zero;
    fake_convert(&fake, 3);
    CHECK_EQUAL(fake_status(&fake).saturated_conversions, 3);
    CHECK_EQUAL(fake_status(&fake).error_flags, TAXEL_BOARD_ERROR_FLAG_SATURATED);
    fake_convert(&fake, 0x10010);
    CHECK_EQUAL(fake_status(&fake).saturated_conversions, 0xFFFF);
    fake_sensor_free(&fake);
}

static void boards_of_all_extreme_sizes_scan(void)
{
    static const uint8_t sizes[][2] = {{1, 1}, {16, 15}, {15, 16}, {1, 16}, {16, 1}};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        boot(sizes[i][0], sizes[i][1], 0);
        fake_scan(&fake, 2);
        CHECK_EQUAL(read_snapshot().sequence, 1);
        CHECK(fake_snapshot_is_valid(&fake, snapshot));
        fake_sensor_free(&fake);
    }
}

/* Check that the firmware rejects a configuration that `damage` has made invalid. */
static void check_rejected(void (*damage)(void), const char *description)
{
    fake_sensor_init(&fake, 0x21, 3, 5, 0);
    damage();
    if (!CHECK_EQUAL(fake_sensor_boot(&fake), TAXEL_ERROR_INVALID)) {
        printf("  (%s was not rejected)\n", description);
    }
    fake_sensor_free(&fake);
}

/* Make the configuration invalid: no TX line. */
static void no_rows(void)
{
    fake.config.rows = 0;
}
/* Make the configuration invalid: more TX lines than the protocol permits. */
static void many_rows(void)
{
    fake.config.rows = 17;
}
/* Make the configuration invalid: no RX line. */
static void no_columns(void)
{
    fake.config.columns = 0;
}
/* Make the configuration invalid: more RX lines than the protocol permits. */
static void many_columns(void)
{
    fake.config.columns = 17;
}
/* Make the configuration invalid: no crossing has a taxel. */
static void no_taxels(void)
{
    fake.config.taxel_count = 0;
    memset(fake.crossing_map, 0, sizeof fake.crossing_map);
}
/* Make the configuration invalid: fewer taxels than the crossing map contains. */
static void fewer_taxels(void)
{
    fake.config.taxel_count--;
}
/* Make the configuration invalid: more taxels than the crossing map contains. */
static void more_taxels(void)
{
    fake.config.taxel_count++;
}
/* Make the configuration invalid: an I2C address below the permitted range. */
static void low_address(void)
{
    fake.config.address = 7;
}
/* Make the configuration invalid: an I2C address above the permitted range. */
static void high_address(void)
{
    fake.config.address = 0x78;
}
/* Make the configuration invalid: scan settings without sub-conversions. */
static void no_sub_conversions(void)
{
    fake.config.settings.sub_conversions = 0;
}
/* Make the configuration invalid: scan settings whose largest raw count exceeds 16 bits. */
static void large_count(void)
{
    fake.config.settings.sub_conversions = 0x8000;
    fake.config.settings.sense_clock_divider = 2;
}
/* Make the configuration invalid: scan settings whose modulator clock divider is 0. */
static void no_modulator_clock(void)
{
    fake.config.settings.modulator_clock_divider = 0;
}
/* Make the configuration invalid: scan settings without balancing current. */
static void no_current(void)
{
    fake.config.settings.idac_code = 0;
}

/* Make the configuration invalid: the crossing map has the right number of bits, but one of them is beyond the
 * crossings. */
static void crossing_outside(void)
{
    fake.crossing_map[0] &= 0xFEu;
    fake.crossing_map[15 >> 3] |= 1u << (15 & 7);
}

static void invalid_configurations_are_rejected(void)
{
    check_rejected(no_rows, "no rows");
    check_rejected(many_rows, "17 rows");
    check_rejected(no_columns, "no columns");
    check_rejected(many_columns, "17 columns");
    check_rejected(no_taxels, "no taxels");
    check_rejected(fewer_taxels, "a map of more taxels");
    check_rejected(more_taxels, "a map of fewer taxels");
    check_rejected(low_address, "address 0x07");
    check_rejected(high_address, "address 0x78");
    check_rejected(no_sub_conversions, "no sub-conversions");
    check_rejected(large_count, "a count beyond 16 bits");
    check_rejected(no_modulator_clock, "no modulator clock");
    check_rejected(no_current, "no IDAC current");
    check_rejected(crossing_outside, "a crossing beyond rows x columns");
}

static void a_scan_that_advances_permits_feeding_the_watchdog(void)
{
    boot(4, 6, 0);
    for (unsigned i = 0; i < 1000u; i++) {
        fake.clock_us += 600000u; /* longer than the limit: only the conversions count */
        fake_convert(&fake, 1);
        CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_ADVANCED);
        CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_WAITING);
    }
    CHECK_EQUAL(fake_status(&fake).error_flags & TAXEL_BOARD_ERROR_FLAG_NOT_SCANNING, 0);
    fake_sensor_free(&fake);
}

static void a_missed_interrupt_of_the_converter_is_reported_once(void)
{
    boot(4, 6, 0);
    fake_convert(&fake, 1);
    CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_ADVANCED);
    fake.clock_us += TAXEL_SCAN_STALL_US - 1u;
    CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_WAITING);
    CHECK_EQUAL(fake_status(&fake).error_flags, 0);
    fake.clock_us += 1u;
    CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_STALLED);
    CHECK_EQUAL(fake_status(&fake).error_flags, TAXEL_BOARD_ERROR_FLAG_NOT_SCANNING);
    for (unsigned i = 0; i < 10u; i++) {
        fake.clock_us += TAXEL_SCAN_STALL_US;
        CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_WAITING);
    }
    fake_convert(&fake, 1); /* a late interrupt continues the scan */
    CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_ADVANCED);
    fake.clock_us += TAXEL_SCAN_STALL_US;
    CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_STALLED);
    fake_sensor_free(&fake);
}

static void a_scan_that_is_stopped_by_command_is_no_fault(void)
{
    boot(4, 6, 0);
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_STOP_SCAN));
    for (unsigned i = 0; i < 10u; i++) {
        fake.clock_us += TAXEL_SCAN_STALL_US;
        CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_ADVANCED);
    }
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_START_SCAN)); /* the last conversion never ends */
    CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_WAITING);
    fake.clock_us += TAXEL_SCAN_STALL_US;
    CHECK_EQUAL(taxel_scan_check(&fake.sensor), TAXEL_SCAN_STALLED);
    fake_sensor_free(&fake);
}

int main(void)
{
    RUN(the_scan_goes_tx_by_tx_over_the_taxels);
    RUN(the_snapshot_crc_covers_the_address);
    RUN(sequence_and_timestamp_are_set_at_the_start_of_a_scan);
    RUN(sequence_and_clock_wrap);
    RUN(a_stopped_scan_is_discarded);
    RUN(stop_and_start_work_during_a_conversion);
    RUN(settings_take_effect_with_the_next_scan);
    RUN(settings_of_a_stopped_board_take_effect_at_the_start);
    RUN(saturated_conversions_are_counted_and_the_counter_saturates);
    RUN(boards_of_all_extreme_sizes_scan);
    RUN(invalid_configurations_are_rejected);
    RUN(a_scan_that_advances_permits_feeding_the_watchdog);
    RUN(a_missed_interrupt_of_the_converter_is_reported_once);
    RUN(a_scan_that_is_stopped_by_command_is_no_fault);
    return check_summary();
}
