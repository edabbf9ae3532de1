/* A reader gets one complete scan, never a mixture of two, at any time and with any preemption. */
#include "check.h"
#include "fake_sensor.h"

#define ROWS 3
#define COLUMNS 4
#define SKIP 5 /* 10 taxels */

static struct fake_sensor fake;
static uint8_t snapshot[TAXEL_SNAPSHOT_SIZE(ROWS * COLUMNS)];

/* Start a simulated board, on which some crossings have no taxel. */
static void boot(void)
{
    fake_sensor_init(&fake, 0x30, ROWS, COLUMNS, SKIP);
    CHECK_EQUAL(fake_sensor_boot(&fake), 0);
}

/* Return the number of bytes of a snapshot of the board. */
static size_t snapshot_size(void)
{
    return TAXEL_SNAPSHOT_SIZE(fake.config.taxel_count);
}

/* Read a snapshot, with `between` conversions before each event of the transfer. `with_pointer`: the register pointer
 * is written first. Returns the sequence number that was read. */
static uint16_t read_with_conversions_between(unsigned between, bool with_pointer)
{
    memset(snapshot, 0, sizeof snapshot);
    if (with_pointer) {
        fake_convert(&fake, between);
        CHECK(taxel_sensor_on_address(&fake.sensor, false));
        fake_convert(&fake, between);
        CHECK(taxel_sensor_on_write(&fake.sensor, TAXEL_REGISTER_SNAPSHOT));
    }
    fake_convert(&fake, between);
    const uint32_t scans = fake.sensor.scan.scans;
    CHECK(taxel_sensor_on_address(&fake.sensor, true));
    for (size_t i = 0; i < snapshot_size(); i++) {
        fake_convert(&fake, between);
        snapshot[i] = taxel_sensor_on_read(&fake.sensor);
    }
    fake_convert(&fake, between);
    taxel_sensor_on_stop(&fake.sensor);
    CHECK(fake_snapshot_is_valid(&fake, snapshot));
    CHECK_EQUAL(taxel_get_u16(snapshot), (uint16_t)(scans - 1u));
    return taxel_get_u16(snapshot);
}

static void a_read_returns_one_scan_at_every_instant_of_a_scan(void)
{
    for (unsigned between = 0; between <= 12; between++) {
        for (unsigned start = 0; start <= 2u * ROWS * COLUMNS; start++) {
            boot();
            fake_scan(&fake, 1);
            fake_convert(&fake, start);
            const uint16_t first = read_with_conversions_between(between, true);
            const uint16_t second = read_with_conversions_between(between, false);
            CHECK(second >= first);
            CHECK_EQUAL(fake.overlapping, 0);
            fake_sensor_free(&fake);
        }
    }
}

static unsigned preemptions;

/* End one conversion; simulated interrupt. */
static void convert_once(struct fake_sensor *preempted)
{
    preemptions++;
    fake_convert(preempted, 1);
}

/* A conversion may end immediately before the latch disables interrupts, and immediately after it restores them. */
static void a_conversion_may_preempt_the_latch(void)
{
    for (unsigned start = 0; start <= 2u * ROWS * COLUMNS; start++) {
        boot();
        fake_scan(&fake, 1);
        fake_convert(&fake, start);
        for (unsigned read = 0; read < 12; read++) {
            fake.preempt = convert_once;
            CHECK(fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT, snapshot, snapshot_size()));
            fake.preempt = NULL;
            CHECK(fake_snapshot_is_valid(&fake, snapshot));
        }
        fake_sensor_free(&fake);
    }
    CHECK(preemptions > 100);
}

static unsigned reads_within;

/* Read a snapshot, which must be valid; simulated interrupt. */
static void read_snapshot(struct fake_sensor *preempted)
{
    if (!preempted->sensor.scan.has_newest && !preempted->sensor.scan.has_latched) {
        return; /* no scan is complete yet */
    }
    reads_within++;
    CHECK(fake_read_at(preempted, TAXEL_REGISTER_SNAPSHOT, snapshot, snapshot_size()));
    CHECK(fake_snapshot_is_valid(preempted, snapshot));
}

/* A read may preempt the conversion's interrupt wherever interrupts are enabled. */
static void a_read_may_preempt_the_conversion_interrupt(void)
{
    boot();
    fake.preempt = read_snapshot;
    fake_scan(&fake, 20);
    fake.preempt = NULL;
    CHECK(reads_within > 100);
    CHECK_EQUAL(fake.interrupts_off, 0);
    fake_sensor_free(&fake);
}

static void blocks_read_after_the_latch_form_the_same_snapshot(void)
{
    for (unsigned between = 0; between <= 12; between += 3) {
        boot();
        fake_scan(&fake, 3);
        uint8_t blocks[TAXEL_SNAPSHOT_SIZE(ROWS * COLUMNS) + TAXEL_SMBUS_BLOCK];
        uint8_t pointer = TAXEL_REGISTER_SNAPSHOT;
        for (size_t at = 0; at < snapshot_size(); at += TAXEL_SMBUS_BLOCK) {
            CHECK(fake_read_at(&fake, pointer++, blocks + at, TAXEL_SMBUS_BLOCK));
            fake_convert(&fake, between);
        }
        CHECK(fake_snapshot_is_valid(&fake, blocks));
        CHECK_EQUAL(taxel_get_u16(blocks), 2);
        fake_sensor_free(&fake);
    }
}

static void the_largest_board_is_read_in_blocks(void)
{
    uint8_t blocks[17 * TAXEL_SMBUS_BLOCK];
    fake_sensor_init(&fake, 0x30, 16, 15, 0);
    CHECK_EQUAL(fake_sensor_boot(&fake), 0);
    fake_scan(&fake, 2);
    for (uint8_t block = 0; block <= TAXEL_REGISTER_SNAPSHOT_LAST - TAXEL_REGISTER_SNAPSHOT; block++) {
        CHECK(fake_read_at(&fake, (uint8_t)(TAXEL_REGISTER_SNAPSHOT + block), blocks + block * TAXEL_SMBUS_BLOCK,
                           TAXEL_SMBUS_BLOCK));
        fake_convert(&fake, 50);
    }
    CHECK(fake_snapshot_is_valid(&fake, blocks));
    for (size_t i = snapshot_size(); i < 16u * TAXEL_SMBUS_BLOCK; i++) {
        CHECK_EQUAL(blocks[i], 0xFF);
    }
    fake_sensor_free(&fake);
}

static void before_the_first_scan_a_read_is_not_acknowledged(void)
{
    boot();
    for (unsigned i = 0; i < fake.config.taxel_count; i++) {
        CHECK(!fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT, snapshot, snapshot_size()));
        CHECK(!fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT + 1, snapshot, 8));
        fake_convert(&fake, 1);
    }
    CHECK(!fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT + 1, snapshot, 8)); /* no snapshot is latched yet */
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT, snapshot, snapshot_size()));
    CHECK(fake_snapshot_is_valid(&fake, snapshot));
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT + 1, snapshot, 8));
    CHECK_EQUAL(fake_status(&fake).snapshot_reads, 1); /* a read that was not acknowledged does not count */
    fake_sensor_free(&fake);
}

static void without_a_newer_scan_the_same_snapshot_is_read_again(void)
{
    uint8_t again[sizeof snapshot];
    boot();
    fake_scan(&fake, 4);
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT, snapshot, snapshot_size()));
    fake_convert(&fake, fake.config.taxel_count - 1u);
    CHECK(fake_read(&fake, again, snapshot_size()));
    CHECK_BYTES(again, snapshot, snapshot_size());
    fake_convert(&fake, 1);
    CHECK(fake_read(&fake, again, snapshot_size()));
    CHECK_EQUAL(taxel_get_u16(again), taxel_get_u16(snapshot) + 1u);
    fake_sensor_free(&fake);
}

int main(void)
{
    RUN(a_read_returns_one_scan_at_every_instant_of_a_scan);
    RUN(a_conversion_may_preempt_the_latch);
    RUN(a_read_may_preempt_the_conversion_interrupt);
    RUN(blocks_read_after_the_latch_form_the_same_snapshot);
    RUN(the_largest_board_is_read_in_blocks);
    RUN(before_the_first_scan_a_read_is_not_acknowledged);
    RUN(without_a_newer_scan_the_same_snapshot_is_read_again);
    return check_summary();
}
