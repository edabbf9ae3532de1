/* Random faults, commands and bytes of noise in random emulated worlds. Usage: stress_world [SEED [ROUNDS]]
 *
 * A failure prints the command that replays its world. */
#include <stdlib.h>

#include "check.h"
#include "emulator/base/random.h"
#include "fake_world.h"

#define FAULTS_S 1.5 /* duration of the random faults */
#define REPAIR_S (FAULTS_S + 0.5)

static struct fake_world fake;
static struct random_source source;
static unsigned boards;

/* Return a random whole number from 0 to limit - 1. */
static unsigned random_below(unsigned limit)
{
    return (unsigned)(random_u64(&source) % limit);
}

/* Add 40 random faults at random times to the world, and the end of all faults at REPAIR_S. */
static void add_faults(void)
{
    double time = 0.3;
    for (unsigned i = 0; i < 40; i++) {
        static const double values[] = {0, 1, 2, 5, 9, 20, 300, 6000, 20000};
        const enum fault_kind kind = random_below(16) ? (enum fault_kind)random_below(FAULT_HUB_UNPLUG) : FAULT_MUTE;
        time += 0.04 * random_uniform(&source);
        if (random_below(5) == 0) {
            const enum fault_kind branch_kind =
                (enum fault_kind)(FAULT_BRANCH_OPEN + random_below(FAULT_BRANCH_RESTORE - FAULT_BRANCH_OPEN + 1u));
            fake_world_fault_at(&fake, time, branch_kind, (uint8_t)(0x20 + random_below(boards)), 1.0 + random_below(2),
                                random_below(2) ? 0.0 : 400.0);
            continue;
        }
        fake_world_fault_at(&fake, time, kind, (uint8_t)(0x20 + random_below(boards)), values[random_below(9)],
                            random_below(30));
    }
    for (unsigned i = 0; i < boards; i++) { /* end all faults */
        fake_world_fault(&fake, REPAIR_S, FAULT_BRANCH_RESTORE, (uint8_t)(0x20 + i), 0);
        fake_world_fault(&fake, REPAIR_S, FAULT_PLUG, (uint8_t)(0x20 + i), 0);
        fake_world_fault(&fake, REPAIR_S, FAULT_CORRUPT, (uint8_t)(0x20 + i), 0);
        fake_world_fault(&fake, REPAIR_S, FAULT_NACK, (uint8_t)(0x20 + i), 0);
        fake_world_fault(&fake, REPAIR_S, FAULT_HOLD_SDA, (uint8_t)(0x20 + i), 0);
        fake_world_fault(&fake, REPAIR_S, FAULT_HOLD_SCL, (uint8_t)(0x20 + i), 0);
    }
    fake_world_fault(&fake, REPAIR_S, FAULT_MUTE, 0, 0);
}

/* Send a random command with random arguments from the host to the emulated hub. */
static void send_random_command(void)
{
    static const uint8_t codes[] = {TAXEL_COMMAND_START,        TAXEL_COMMAND_SCAN_BUS,
                                    TAXEL_COMMAND_I2C_TRANSFER, TAXEL_COMMAND_SET_SCAN_SETTINGS,
                                    TAXEL_COMMAND_GET_STATUS,   TAXEL_COMMAND_GET_BOARD_INFO,
                                    TAXEL_COMMAND_GET_TIME,     TAXEL_COMMAND_STOP,
                                    TAXEL_COMMAND_SET_RATE};
    uint8_t bytes[66];
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)random_u64(&source);
    }
    const uint8_t code = random_below(8) ? codes[random_below(sizeof codes)] : (uint8_t)random_below(256);
    size_t size = 0;
    if (code == TAXEL_COMMAND_I2C_TRANSFER) {
        size = 2u + random_below(65);
        bytes[0] = (uint8_t)(0x20 + random_below(boards + 1));
        bytes[1] = (uint8_t)random_below(66);
    } else if (code == TAXEL_COMMAND_SET_SCAN_SETTINGS) {
        const struct taxel_scan_settings settings = {(uint16_t)(80u + random_below(80)), 40, (uint8_t)random_below(2),
                                                     16, 96};
        bytes[0] = random_below(2) ? (uint8_t)(0x20 + random_below(boards)) : 0;
        taxel_scan_settings_pack(&settings, bytes + 1);
        size = TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE;
    } else if (code == TAXEL_COMMAND_GET_BOARD_INFO) {
        bytes[0] = random_below(2) ? (uint8_t)(0x20 + random_below(boards)) : 0;
        size = 1;
    } else if (code == TAXEL_COMMAND_SET_RATE) {
        taxel_put_u32(bytes, random_below(20000));
        size = 4;
    } else if (code == TAXEL_COMMAND_REBOOT) {
        return; /* a reboot resets the counters that are checked */
    }
    if (random_below(6) == 0) {
        (void)uart_send_from_host(&fake.world.uart, bytes, random_below(66), fake.world.now); /* noise */
    }
    fake_world_command(&fake, code, bytes, size);
}

/* Check that the hub polls every board again. After damaged identities the hub may treat an address as empty; it
 * probes the address again within 64 cycles. */
static void check_all_boards_stream(void)
{
    uint32_t before[6];
    const uint32_t cycles = fake.world.hub.hub.cycle.count;
    for (unsigned i = 0; i < boards; i++) {
        before[i] = fake_world_slot(&fake, (uint8_t)(0x20 + i))
                        ? taxel_hub_polls(fake_world_slot(&fake, (uint8_t)(0x20 + i)))
                        : 0;
    }
    for (unsigned i = 0; i < 300 && fake.world.hub.hub.cycle.count - cycles < 75u; i++) {
        CHECK_EQUAL(fake_world_run(&fake, 0.1), 0);
    }
    for (unsigned i = 0; i < boards; i++) {
        const struct taxel_hub_slot *slot = fake_world_slot(&fake, (uint8_t)(0x20 + i));
        CHECK(slot && slot->state == TAXEL_BOARD_STATE_STREAMING && taxel_hub_polls(slot) > before[i] + 3u);
    }
}

/* Describe a star of one or two branches with random capacitances. */
static void describe_wiring(void)
{
    struct wiring_description *wiring = &fake.description.wiring;
    wiring->is_buffered = random_below(2);
    wiring->hub_pullup_ohm = 2200.0;
    wiring->hub_capacitance_pf = 10.0;
    wiring->branch_count = 1u + random_below(2);
    for (size_t i = 0; i < wiring->branch_count; i++) {
        wiring->branches[i] = (struct branch_description){
            .name = {(char)('a' + (int)i)}, .pullup_ohm = 2200.0, .capacitance_pf = 50.0 + random_below(60)};
    }
    for (unsigned i = 0; i < boards; i++) {
        wiring->branch_of[0x20 + i] = (uint8_t)(1u + i % wiring->branch_count);
    }
}

static void random_world_recovers_from_random_faults(void)
{
    boards = 1u + random_below(6);
    fake_world_describe(&fake, boards, (uint16_t)(1u + random_below(100)));
    fake.description.seed = random_u64(&source);
    fake.description.scl_hz = random_below(2) ? 400e3 : 100e3;
    fake.description.baud = random_below(3) ? 1e6 : 115200.0;
    fake.description.hub_clock_ppm = 100.0 * random_uniform(&source);
    describe_wiring();
    add_faults();
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    (void)fake_world_start(&fake);
    while (fake.world.now < (vtime)((REPAIR_S) * (double)VTIME_SECOND)) {
        send_random_command();
        CHECK_EQUAL(fake_world_run(&fake, 0.05 * random_uniform(&source)), 0);
        CHECK(fake_world_adds_up(&fake));
    }
    /* After the end of the faults the hub responds, and every board streams. */
    uint8_t period[4] = {0};
    CHECK_EQUAL(fake_world_run(&fake, 1.5), 0);
    const uint8_t delimiter[] = {0};
    /* ends a frame of noise */
    (void)uart_send_from_host(&fake.world.uart, delimiter, sizeof delimiter, fake.world.now);
    fake_world_command(&fake, TAXEL_COMMAND_SET_RATE, period, sizeof period);
    fake_world_command(&fake, TAXEL_COMMAND_START, NULL, 0);
    CHECK_EQUAL(fake_world_run(&fake, 1.0), 0);
    CHECK_EQUAL(fake.reply_tag, fake.tag);
    CHECK_EQUAL(fake.reply_status, 0);
    check_all_boards_stream();
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
}

/* Run random worlds with the seeds SEED, SEED + 1 and so on (arguments: SEED ROUNDS), and print the command that
 * replays a failed world. Exit status 1 after a failure. */
int main(int argc, char **argv)
{
    const uint64_t seed = argc > 1 ? strtoull(argv[1], NULL, 0) : 1;
    const unsigned rounds = argc > 2 ? (unsigned)strtoul(argv[2], NULL, 0) : 40;
    for (unsigned round = 0; round < rounds; round++) {
        random_init(&source, seed + round, 0);
        RUN(random_world_recovers_from_random_faults);
        if (check_state.failures) {
            printf("replay: stress_world %llu 1\n", (unsigned long long)(seed + round));
        }
    }
    printf("seeds %llu to %llu\n", (unsigned long long)seed, (unsigned long long)(seed + rounds - 1u));
    return check_summary();
}
