/* Writes to a board: settings and commands take effect completely, at the stop, or not at all; all other writes are
 * rejected. */
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

/* Read the scan settings of the board, whose CRC must be right. */
static struct taxel_scan_settings read_settings(void)
{
    uint8_t bytes[TAXEL_SETTINGS_REGISTER_SIZE];
    struct taxel_scan_settings settings;
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_SETTINGS, bytes, sizeof bytes));
    taxel_scan_settings_unpack(&settings, bytes);
    CHECK_EQUAL(taxel_get_u32(bytes + 8), taxel_crc32(taxel_crc32(0, &fake.config.address, 1), bytes, 8));
    return settings;
}

/* Check the number of rejected writes, an error flag, that the settings are unchanged, and that CLEAR_COUNTERS clears
 * number and flag. */
static void check_rejected(uint16_t rejected, uint8_t flag)
{
    const struct taxel_status status = fake_status(&fake);
    CHECK_EQUAL(status.rejected_writes, rejected);
    CHECK((status.error_flags & flag) == flag);
    CHECK_EQUAL(read_settings().sub_conversions, 160);
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_CLEAR_COUNTERS));
    CHECK_EQUAL(fake_status(&fake).rejected_writes, 0);
    CHECK_EQUAL(fake_status(&fake).error_flags, 0);
}

static void valid_settings_read_back_at_once(void)
{
    const struct taxel_scan_settings settings = {200, 30, 3, 9, 77};
    boot();
    CHECK(fake_write_settings(&fake, &settings));
    const struct taxel_scan_settings stored = read_settings();
    CHECK_EQUAL(stored.sub_conversions, 200);
    CHECK_EQUAL(stored.sense_clock_divider, 30);
    CHECK_EQUAL(stored.modulator_clock_divider, 3);
    CHECK_EQUAL(stored.idac_code, 9);
    CHECK_EQUAL(stored.settle_cycles, 77);
    CHECK_EQUAL(fake_status(&fake).rejected_writes, 0);
    fake_sensor_free(&fake);
}

static void settings_out_of_range_are_rejected(void)
{
    static const struct taxel_scan_settings wrong[] = {{0, 40, 1, 16, 0},    {160, 0, 1, 16, 0},
                                                       {256, 256, 1, 16, 0}, {65535, 65535, 1, 1, 0},
                                                       {160, 40, 0, 16, 0},  {160, 40, 1, 0, 0}};
    boot();
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        CHECK(fake_write_settings(&fake, &wrong[i]));
        check_rejected(1, TAXEL_BOARD_ERROR_FLAG_SETTINGS_REJECTED);
    }
    fake_scan(&fake, 2);
    CHECK_EQUAL(fake.configured, 1);
    fake_sensor_free(&fake);
}

/* Fill the bytes of a valid write of scan settings, which the tests damage. */
static void fill_settings_write(uint8_t *bytes)
{
    const struct taxel_scan_settings settings = {200, 30, 3, 9, 77};
    const uint8_t address = 0x23;
    bytes[0] = TAXEL_REGISTER_SETTINGS;
    taxel_scan_settings_pack(&settings, bytes + 1);
    taxel_put_u32(bytes + 9, taxel_crc32(taxel_crc32(0, &address, 1), bytes + 1, 8));
}

static void damaged_settings_are_rejected(void)
{
    uint8_t bytes[15] = {0};
    boot();
    for (unsigned bit = 8; bit < 8u * 13u; bit++) {
        fill_settings_write(bytes);
        bytes[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        CHECK(fake_write(&fake, bytes, 13));
        check_rejected(1, TAXEL_BOARD_ERROR_FLAG_SETTINGS_REJECTED);
    }
    fill_settings_write(bytes);
    for (size_t size = 2; size < 13; size++) {
        CHECK(fake_write(&fake, bytes, size));
        check_rejected(1, TAXEL_BOARD_ERROR_FLAG_SETTINGS_REJECTED);
    }
    CHECK(!fake_write(&fake, bytes, 14));
    check_rejected(1, 0);
    fake_sensor_free(&fake);
}

/* After a write that a bus error has aborted, its bytes are still in the buffer of the board. */
static void truncated_settings_are_not_completed_by_the_previous_write(void)
{
    uint8_t bytes[13];
    boot();
    fill_settings_write(bytes);
    for (size_t size = 2; size < sizeof bytes; size++) {
        CHECK(taxel_sensor_on_address(&fake.sensor, false));
        for (size_t i = 0; i < sizeof bytes; i++) {
            CHECK(taxel_sensor_on_write(&fake.sensor, bytes[i]));
        }
        taxel_sensor_on_bus_error(&fake.sensor);
        CHECK(fake_write(&fake, bytes, size));
        check_rejected(1, TAXEL_BOARD_ERROR_FLAG_SETTINGS_REJECTED);
    }
    fake_scan(&fake, 1);
    CHECK_EQUAL(fake.configured, 1);
    fake_sensor_free(&fake);
}

static void a_write_takes_effect_only_at_its_stop(void)
{
    uint8_t bytes[13], byte;
    boot();
    fill_settings_write(bytes);
    for (unsigned ending = 0; ending < 4; ending++) {
        CHECK(taxel_sensor_on_address(&fake.sensor, false));
        for (size_t i = 0; i < sizeof bytes; i++) {
            CHECK(taxel_sensor_on_write(&fake.sensor, bytes[i]));
        }
        switch (ending) {
        case 0: /* repeated start for reading */
            CHECK(taxel_sensor_on_address(&fake.sensor, true));
            byte = taxel_sensor_on_read(&fake.sensor);
            CHECK_EQUAL(byte, 160);
            taxel_sensor_on_stop(&fake.sensor);
            break;
        case 1: /* repeated start for writing another pointer */
            CHECK(taxel_sensor_on_address(&fake.sensor, false));
            CHECK(taxel_sensor_on_write(&fake.sensor, TAXEL_REGISTER_STATUS));
            taxel_sensor_on_stop(&fake.sensor);
            break;
        case 2: /* a bus error, and the stop that clears it */
            taxel_sensor_on_bus_error(&fake.sensor);
            taxel_sensor_on_stop(&fake.sensor);
            break;
        default: /* the master stops, and continues later */
            break;
        }
        fake_scan(&fake, 1);
        CHECK_EQUAL(fake.configured, 1);
        CHECK_EQUAL(read_settings().sub_conversions, 160);
    }
    fake_sensor_free(&fake);
}

/* A master that ignores the missing acknowledge: none of its bytes may take effect. */
static void bytes_after_a_rejected_byte_have_no_effect(void)
{
    boot();
    CHECK(taxel_sensor_on_address(&fake.sensor, false));
    CHECK(taxel_sensor_on_write(&fake.sensor, TAXEL_REGISTER_COMMAND));
    for (unsigned i = 0; i < TAXEL_SETTINGS_REGISTER_SIZE; i++) {
        CHECK(taxel_sensor_on_write(&fake.sensor, 0xAA));
    }
    CHECK(!taxel_sensor_on_write(&fake.sensor, 0xAA));
    CHECK(!taxel_sensor_on_write(&fake.sensor, TAXEL_BOARD_COMMAND_RESTART));
    CHECK(!taxel_sensor_on_write(&fake.sensor, (uint8_t)~TAXEL_BOARD_COMMAND_RESTART));
    taxel_sensor_on_stop(&fake.sensor);
    CHECK_EQUAL(fake.restarts, 0);
    CHECK_EQUAL(fake_status(&fake).rejected_writes, 1);
    fake_sensor_free(&fake);
}

static void a_command_requires_its_complement(void)
{
    boot();
    for (unsigned command = 0; command < 256; command++) {
        for (unsigned other = 0; other < 256; other++) {
            const uint8_t bytes[3] = {TAXEL_REGISTER_COMMAND, (uint8_t)command, (uint8_t)other};
            if ((command ^ other) != 0xFFu || command == 0 || command > TAXEL_BOARD_COMMAND_ENTER_BOOTLOADER) {
                CHECK(fake_write(&fake, bytes, sizeof bytes));
            }
        }
    }
    const uint8_t incomplete[2] = {TAXEL_REGISTER_COMMAND, TAXEL_BOARD_COMMAND_RESTART};
    for (unsigned i = 0; i < 10; i++) {
        CHECK(fake_write(&fake, incomplete, sizeof incomplete));
    }
    const uint8_t too_long[4] = {TAXEL_REGISTER_COMMAND, TAXEL_BOARD_COMMAND_RESTART, 0xFB, 0};
    CHECK(fake_write(&fake, too_long, sizeof too_long));
    CHECK_EQUAL(fake.restarts + fake.bootloader_entries, 0);
    CHECK_EQUAL(fake_status(&fake).rejected_writes, 0xFFFF); /* the counter is saturated */
    CHECK_EQUAL(fake_status(&fake).state, TAXEL_SENSOR_SCANNING);
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_RESTART));
    CHECK_EQUAL(fake.restarts, 1);
    fake_sensor_free(&fake);
}

static void the_bootloader_requires_its_key(void)
{
    static const uint8_t right[1u + TAXEL_ENTER_BOOTLOADER_REGISTER_SIZE] = {
        TAXEL_REGISTER_COMMAND, TAXEL_BOARD_COMMAND_ENTER_BOOTLOADER, 0xFA, 'B', 'O', 'O', 'T'};
    uint8_t bytes[sizeof right + 1u] = {0};
    unsigned rejected = 0;
    boot();
    for (size_t size = 2; size <= sizeof right + 1u; size++) { /* also without the key, and with a byte behind it */
        memcpy(bytes, right, sizeof right);
        if (size != sizeof right) {
            CHECK(fake_write(&fake, bytes, size));
            rejected++;
        }
    }
    for (size_t bit = 8; bit < 8u * sizeof right; bit++) {
        memcpy(bytes, right, sizeof right);
        bytes[bit >> 3] ^= (uint8_t)(1u << (bit & 7u));
        CHECK(fake_write(&fake, bytes, sizeof right));
        rejected++;
    }
    memcpy(bytes, right, sizeof right);
    bytes[1] = TAXEL_BOARD_COMMAND_RESTART; /* another command has no key */
    bytes[2] = (uint8_t)~TAXEL_BOARD_COMMAND_RESTART;
    CHECK(fake_write(&fake, bytes, sizeof right));
    CHECK_EQUAL(fake.restarts + fake.bootloader_entries, 0);
    check_rejected((uint16_t)(rejected + 1u), TAXEL_BOARD_ERROR_FLAG_COMMAND_REJECTED);
    CHECK(fake_write(&fake, right, sizeof right));
    CHECK_EQUAL(fake.bootloader_entries, 1);
    CHECK_EQUAL(fake_status(&fake).rejected_writes, 0);
    fake_sensor_free(&fake);
}

static void writes_to_read_only_registers_are_rejected(void)
{
    uint8_t before[TAXEL_IDENTITY_SIZE], after[TAXEL_IDENTITY_SIZE];
    boot();
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_IDENTITY, before, sizeof before));
    for (unsigned pointer = 0; pointer < 256; pointer++) {
        const uint8_t bytes[2] = {(uint8_t)pointer, 0x55};
        CHECK(fake_write(&fake, bytes, sizeof bytes));
        const bool writable = pointer == TAXEL_REGISTER_SETTINGS || pointer == TAXEL_REGISTER_COMMAND;
        check_rejected(1, writable ? 0 : TAXEL_BOARD_ERROR_FLAG_READ_ONLY_WRITE);
    }
    CHECK(fake_read_at(&fake, TAXEL_REGISTER_IDENTITY, after, sizeof after));
    CHECK_BYTES(after, before, sizeof after);
    fake_sensor_free(&fake);
}

static void bus_errors_are_counted_and_the_counter_saturates(void)
{
    boot();
    for (unsigned i = 0; i < 0x10005; i++) {
        taxel_sensor_on_bus_error(&fake.sensor);
    }
    CHECK_EQUAL(fake_status(&fake).bus_errors, 0xFFFF);
    CHECK(fake_command(&fake, TAXEL_BOARD_COMMAND_CLEAR_COUNTERS));
    CHECK_EQUAL(fake_status(&fake).bus_errors, 0);
    fake_sensor_free(&fake);
}

int main(void)
{
    RUN(valid_settings_read_back_at_once);
    RUN(settings_out_of_range_are_rejected);
    RUN(damaged_settings_are_rejected);
    RUN(truncated_settings_are_not_completed_by_the_previous_write);
    RUN(a_write_takes_effect_only_at_its_stop);
    RUN(bytes_after_a_rejected_byte_have_no_effect);
    RUN(a_command_requires_its_complement);
    RUN(the_bootloader_requires_its_key);
    RUN(writes_to_read_only_registers_are_rejected);
    RUN(bus_errors_are_counted_and_the_counter_saturates);
    return check_summary();
}
