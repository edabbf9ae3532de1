/* Random I2C traffic and conversions in random order on the sensor firmware. Usage: stress_sensor [SEED [ROUNDS]] */
#include <stdlib.h>

#include "check.h"
#include "emulator/base/random.h"
#include "fake_sensor.h"

#define ACTIONS 3000u

static struct fake_sensor fake;
static struct random_source source;
static uint8_t snapshot[TAXEL_SNAPSHOT_SIZE(TAXEL_TAXELS_MAX)];

/* Return a random whole number from 0 to limit - 1. */
static unsigned random_below(unsigned limit)
{
    return (unsigned)(random_u64(&source) % limit);
}

/* Return a random byte, with an increased probability of register addresses and commands. */
static uint8_t likely_byte(void)
{
    static const uint8_t meaningful[] = {0x00, 0x40, 0x44, 0x60, 0x70, 0x80, 0x81, 0x8F, 0x90,
                                         0xA0, 1,    2,    3,    0xFE, 0xFD, 0xFC, 0xFF};
    return random_below(2) ? meaningful[random_below(sizeof meaningful)] : (uint8_t)random_below(256);
}

/* Simulate an interrupt at a random instant: end one conversion or none. */
static void preempt(struct fake_sensor *preempted)
{
    fake_convert(preempted, random_below(2));
}

/* Execute one random action on the simulated board: an event of the I2C slave, conversions, or a write of settings or a
 * command. */
static void run_random_action(void)
{
    const struct taxel_scan_settings settings = {(uint16_t)random_below(400), (uint16_t)random_below(400),
                                                 (uint8_t)random_below(3), (uint8_t)random_below(3),
                                                 (uint16_t)random_below(65536)};
    switch (random_below(12)) {
    case 0:
        (void)taxel_sensor_on_address(&fake.sensor, random_below(2));
        break;
    case 1:
    case 2:
        (void)taxel_sensor_on_write(&fake.sensor, likely_byte());
        break;
    case 3:
    case 4:
        (void)taxel_sensor_on_read(&fake.sensor);
        break;
    case 5:
        taxel_sensor_on_stop(&fake.sensor);
        break;
    case 6:
        taxel_sensor_on_bus_error(&fake.sensor);
        break;
    case 7:
        (void)fake_command(&fake, (uint8_t)(1u + random_below(3)));
        break;
    case 8:
        (void)fake_write_settings(&fake, &settings);
        break;
    case 9:
        (void)fake_read_at(&fake, likely_byte(), snapshot, random_below(60));
        break;
    default:
        fake_convert(&fake, random_below(40));
        break;
    }
}

/* Check what must hold after every action: no overlapping conversions, three distinct snapshot buffers, valid
 * settings, and a snapshot with the counts of one scan. */
static void check_invariants(void)
{
    const struct taxel_scan *scan = &fake.sensor.scan;
    CHECK_EQUAL(fake.overlapping, 0);
    CHECK_EQUAL(fake.interrupts_off, 0);
    CHECK_EQUAL(fake.configured_while_converting, 0);
    CHECK(scan->scanning != scan->newest && scan->newest != scan->latched && scan->latched != scan->scanning);
    CHECK(taxel_scan_settings_are_valid(&fake.sensor.settings));
    CHECK_EQUAL(scan->converting, fake.converting);
    CHECK(scan->converting || fake.sensor.state == TAXEL_SENSOR_STOPPED);
    CHECK(fake.tx < fake.config.rows && fake.rx < fake.config.columns);
    const uint32_t scans = scan->scans;
    if (fake_read_at(&fake, TAXEL_REGISTER_SNAPSHOT, snapshot, TAXEL_SNAPSHOT_SIZE(fake.config.taxel_count))) {
        CHECK(fake_snapshot_is_valid(&fake, snapshot));
    } else {
        CHECK_EQUAL(scans, 0);
    }
}

/* Board of random size and address; only a board without taxels may refuse to start. */
static void invariants_hold_under_random_traffic(void)
{
    fake_sensor_init(&fake, (uint8_t)(8u + random_below(112)), (uint8_t)(1u + random_below(15)),
                     (uint8_t)(1u + random_below(16)), 2u + random_below(5));
    if (fake_sensor_boot(&fake)) {
        CHECK_EQUAL(fake.config.taxel_count, 0); /* the only possible error of this configuration */
    } else {
        fake.preempt = preempt;
        for (unsigned i = 0; i < ACTIONS; i++) {
            run_random_action();
            if (i % 16u == 0) {
                check_invariants();
            }
        }
    }
    fake_sensor_free(&fake);
}

/* Run random rounds with the seeds SEED, SEED + 1 and so on (arguments: SEED ROUNDS), and print the command that
 * replays a failed round. Exit status 1 after a failure. */
int main(int argc, char **argv)
{
    const uint64_t seed = argc > 1 ? strtoull(argv[1], NULL, 0) : 1;
    const unsigned rounds = argc > 2 ? (unsigned)strtoul(argv[2], NULL, 0) : 400;
    for (unsigned round = 0; round < rounds; round++) {
        random_init(&source, seed + round, 0);
        RUN(invariants_hold_under_random_traffic);
        if (check_state.failures) {
            printf("replay: stress_sensor %llu 1\n", (unsigned long long)(seed + round));
            break;
        }
    }
    printf("seeds %llu to %llu\n", (unsigned long long)seed, (unsigned long long)(seed + rounds - 1u));
    return check_summary();
}
