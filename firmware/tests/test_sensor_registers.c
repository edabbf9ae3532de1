/* The board's I2C register machine: identity, status, reads at and beyond every address. */
#include "check.h"
#include "codec/crc32.h"
#include "fake_sensor.h"

static struct fake_sensor fake;

/* Start a simulated board with 4 TX and 6 RX lines, which completes two scans. */
static void boot(void)
{
    fake_sensor_init(&fake, 0x23, 4, 6, 7);
    CHECK_EQUAL(fake_sensor_boot(&fake), 0);
    fake_scan(&fake, 2);
}

static void the_identity_holds_the_configuration(void)
{
    uint8_t bytes[TAXEL_IDENTITY_SIZE];
    struct taxel_identity identity;
    boot();
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_IDENTITY, bytes, sizeof bytes));
    taxel_identity_unpack(&identity, bytes);
    CHECK_EQUAL(identity.who_am_i, 'T');
    CHECK_EQUAL(identity.map_version, TAXEL_REGISTER_MAP_VERSION_MIN); /* without compact snapshots */
    CHECK_EQUAL(identity.firmware_major, 1);
    CHECK_EQUAL(identity.firmware_minor, 2);
    CHECK_EQUAL(identity.firmware_patch, 3);
    CHECK_EQUAL(identity.kind, 3);
    CHECK_EQUAL(identity.address, 0x23);
    CHECK_EQUAL(identity.map_revision, TAXEL_REGISTER_MAP_REVISION);
    CHECK_BYTES(identity.unique_id, fake.config.unique_id, 8);
    CHECK_EQUAL(identity.rows, 4);
    CHECK_EQUAL(identity.columns, 6);
    CHECK_EQUAL(identity.taxel_count, fake.config.taxel_count);
    CHECK_EQUAL(identity.snapshot_size, 10 + 2 * fake.config.taxel_count);
    CHECK_BYTES(identity.crossing_map, fake.crossing_map, TAXEL_CROSSING_MAP_SIZE);
    CHECK_EQUAL(identity.crc32, taxel_crc32(0, bytes, 54));
    fake_sensor_free(&fake);
}

static void every_register_is_readable_and_reads_ff_beyond_its_end(void)
{
    static const struct {
        unsigned first, size;
    } areas[] = {{TAXEL_REGISTER_IDENTITY, TAXEL_IDENTITY_SIZE},
                 {TAXEL_REGISTER_STATUS, TAXEL_STATUS_SIZE},
                 {TAXEL_REGISTER_SETTINGS, TAXEL_SETTINGS_REGISTER_SIZE}};
    uint8_t bytes[700];
    boot();
    for (unsigned pointer = 0; pointer < 256; pointer++) {
        size_t valid = 0;
        CHECK(fake_read_at(&fake, (uint8_t)pointer, bytes, sizeof bytes));
        for (size_t i = 0; i < sizeof areas / sizeof areas[0]; i++) {
            if (pointer >= areas[i].first && pointer < areas[i].first + areas[i].size) {
                valid = areas[i].first + areas[i].size - pointer;
            }
        }
        valid = pointer == TAXEL_REGISTER_FAULT ? TAXEL_FAULT_REGISTER_SIZE : valid;
        const size_t block = TAXEL_SMBUS_BLOCK * (pointer - TAXEL_REGISTER_SNAPSHOT);
        if (pointer >= TAXEL_REGISTER_SNAPSHOT && pointer <= TAXEL_REGISTER_SNAPSHOT_LAST &&
            block < TAXEL_SNAPSHOT_SIZE(fake.config.taxel_count)) {
            valid = TAXEL_SNAPSHOT_SIZE(fake.config.taxel_count) - block;
        }
        for (size_t i = valid; i < sizeof bytes; i++) {
            CHECK_EQUAL(bytes[i], 0xFF);
        }
    }
    fake_sensor_free(&fake);
}

static void a_read_may_begin_inside_a_register_block(void)
{
    uint8_t whole[TAXEL_IDENTITY_SIZE], part[8], clock[4];
    boot();
    fake.clock_us = 0x12345678u;
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_IDENTITY, whole, sizeof whole));
    CHECK(fake_read_at(&fake, 17, part, sizeof part));
    CHECK_BYTES(part, whole + 17, sizeof part);
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_CLOCK, clock, sizeof clock));
    CHECK_EQUAL(taxel_get_u32(clock), 0x12345678u);
    fake_sensor_free(&fake);
}

static void the_status_is_latched_at_one_instant(void)
{
    uint8_t bytes[TAXEL_STATUS_SIZE];
    struct taxel_status status;
    boot();
    const uint32_t clock_us = fake.clock_us;
    uint8_t pointer = TAXEL_REGISTER_STATUS;
    CHECK(taxel_sensor_on_address(&fake.sensor, false) && taxel_sensor_on_write(&fake.sensor, pointer));
    CHECK(taxel_sensor_on_address(&fake.sensor, true));
    for (size_t i = 0; i < sizeof bytes; i++) {
        fake_scan(&fake, 1);
        bytes[i] = taxel_sensor_on_read(&fake.sensor);
    }
    taxel_sensor_on_stop(&fake.sensor);
    taxel_status_unpack(&status, bytes);
    CHECK_EQUAL(status.clock_us, clock_us);
    CHECK_EQUAL(status.scans, 2);
    CHECK_EQUAL(status.reset_cause, TAXEL_RESET_CAUSE_WATCHDOG);
    CHECK_EQUAL(status.state, TAXEL_SENSOR_SCANNING);
    fake_sensor_free(&fake);
}

static void a_read_without_a_pointer_write_repeats_the_last_register(void)
{
    uint8_t first[4], again[4];
    boot();
    CHECK(fake_read_at(&fake, 8, first, sizeof first));
    CHECK(fake_read(&fake, again, sizeof again));
    CHECK_BYTES(again, first, sizeof again);
    CHECK(fake_write(&fake, NULL, 0)); /* a probe: address and nothing else */
    CHECK(fake_read(&fake, again, sizeof again));
    CHECK_BYTES(again, first, sizeof again);
    fake_sensor_free(&fake);
}

static void the_fault_register_holds_the_record_of_the_port(void)
{
    static const uint8_t record[TAXEL_FAULT_RECORD_SIZE] = {
        TAXEL_FAULT_CODE_EXCEPTION, 3, 2, 0, 0x2C, 0x1A, 0, 0, 0x47, 0x1B, 0, 0};
    static const uint8_t none[TAXEL_FAULT_RECORD_SIZE] = {0};
    uint8_t bytes[TAXEL_FAULT_REGISTER_SIZE];
    boot();
    for (unsigned i = 0; i < 2u; i++) {
        CHECK(fake_read_at(&fake, TAXEL_REGISTER_FAULT, bytes, sizeof bytes));
        CHECK_BYTES(bytes, i ? record : none, sizeof record);
        const uint32_t crc = taxel_crc32(taxel_crc32(0, &fake.config.address, 1), bytes, TAXEL_FAULT_RECORD_SIZE);
        CHECK_EQUAL(taxel_get_u32(bytes + TAXEL_FAULT_REGISTER_OFFSET_CRC32), crc);
        fake.config.fault_record = record;
    }
    fake_sensor_free(&fake);
}

int main(void)
{
    RUN(the_identity_holds_the_configuration);
    RUN(every_register_is_readable_and_reads_ff_beyond_its_end);
    RUN(a_read_may_begin_inside_a_register_block);
    RUN(the_status_is_latched_at_one_instant);
    RUN(a_read_without_a_pointer_write_repeats_the_last_register);
    RUN(the_fault_register_holds_the_record_of_the_port);
    return check_summary();
}
