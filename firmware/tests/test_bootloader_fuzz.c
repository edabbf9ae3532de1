/* Random and truncated packets, power cuts and resets in any order: only the free slot and the records are ever
 * written, and the confirmed image always starts.
 *
 * test_bootloader_fuzz [packets [seed]] */
#include <stdlib.h>

#include "check.h"
#include "codec/crc32.h"
#include "test_bootloader_bench.h"

#define OTHERS 4u

static struct bench bench;
static const uint8_t bytes_of_zero[TAXEL_BOOT_SEARCH_ARGUMENTS_SIZE];
static struct bench_image image, others[OTHERS];
static struct random_source random_actions;
static jmp_buf power;
static unsigned packets = 100000;
static uint64_t seed = 22;

/* Return a random whole number from 0 to limit - 1. */
static unsigned random_below(unsigned limit)
{
    return (unsigned)(random_u64(&random_actions) % limit);
}

/* Return a random code of a command, in most cases a defined one. */
static uint8_t any_command(void)
{
    static const uint8_t known[] = {0x31, 0x32, 0x33, 0x34, 0x35, 0x36, 0x37, 0x37, 0x37, 0x38, 0x39,
                                    0x39, 0x39, 0x3A, 0x3B, 0x3C, 0x50, 0x51, 0x52, 0x53, 0x53};
    return random_below(20) ? known[random_below(sizeof known)] : (uint8_t)random_below(256);
}

/* Return a random length of the data of a command, often a length that the command permits. */
static unsigned any_length(uint8_t command)
{
    static const uint8_t lengths[] = {0, 1, 3, 6, 9, 44, 57};
    switch (random_below(4)) {
    case 0:
        return random_below(58);
    case 1:
        return command == TAXEL_BOOT_COMMAND_PROGRAM_ROW ? 3u + TAXEL_BOOT_ROW_SIZE - bench.boot.fill
               : command == TAXEL_BOOT_COMMAND_SEND_DATA ? 40u
                                                         : 3u;
    default:
        return lengths[random_below(sizeof lengths)];
    }
}

/* Send a packet with a random command, length and data to the bootloader, sometimes with a damaged byte. */
static void send_random_packet(void)
{
    uint8_t data[256], bytes[256], response[TAXEL_BOOT_PACKET_MAX];
    const uint8_t command = any_command();
    unsigned size = any_length(command);
    size = size > 57u ? 57u : size;
    for (unsigned i = 0; i < sizeof data; i++) {
        data[i] = (uint8_t)random_u64(&random_actions);
    }
    if (random_below(2)) { /* an existing row, a slot, no search for other boards */
        data[0] = (uint8_t)random_below(2);
        data[1] = (uint8_t)random_below(256);
        data[2] = 0;
        data[0] = command == TAXEL_BOOT_COMMAND_SEARCH || random_below(2) ? 0 : data[0];
    }
    if (command == TAXEL_BOOT_COMMAND_WRITE_CONFIGURATION) {
        memcpy(data, bench.unique_id, 8);
        data[8] = TAXEL_BOOT_VERSION;
        data[9] = (uint8_t)(TAXEL_ADDRESS_MIN + random_below(112));
        data[10] = 0;
    }
    bench.checksum = random_below(16) ? bench.boot.checksum : (uint8_t)random_below(2);
    unsigned packet_size = bench_packet(&bench, command, data, size, bytes);
    for (unsigned damage = random_below(8) == 0 ? 1u + random_below(3) : 0; damage; damage--) {
        bytes[random_below(packet_size)] = (uint8_t)random_u64(&random_actions);
    }
    if (random_below(16) == 0) {
        packet_size = 1u + random_below(200);
    }
    (void)bench_exchange(&bench, bytes, packet_size, response);
}

/* Write random bytes to a random flash row with the commands of the bootloader, often in the free slot. */
static void program_random_row(void)
{
    uint8_t bytes[TAXEL_BOOT_ROW_SIZE];
    const unsigned first = bench.config.flash.layout->first_rows[image.slot ^ 1u];
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)random_u64(&random_actions);
    }
    bench.checksum = bench.boot.checksum;
    (void)bench_send(&bench, TAXEL_BOOT_COMMAND_SYNC, NULL, 0);
    (void)bench_program_row(&bench, (uint16_t)(random_below(2) ? first + random_below(110) : random_below(260)), bytes);
}

/* Execute one random action on the board: a packet, a programmed row, an update, a planned power cut, a reset, or
 * elapsed time. */
static void step(void)
{
    switch (random_below(60)) {
    case 4:
    case 5: /* another image is flashed, which may hang */
        bench.checksum = bench.boot.checksum;
        (void)bench_program(&bench, &others[random_below(OTHERS)]);
        break;
    case 6:
    case 7:
    case 8:
    case 9:
    case 10:
    case 11:
        program_random_row();
        break;
    case 12:
        (void)bench_send(&bench, TAXEL_BOOT_COMMAND_SEARCH, bytes_of_zero, TAXEL_BOOT_SEARCH_ARGUMENTS_SIZE);
        break;
    case 0:
        bench_reset(&bench, (uint8_t)random_below(4));
        break;
    case 1:
        bench.clock_us += random_below(2u * TAXEL_BOOT_LISTEN_US);
        bench_run(&bench);
        break;
    case 2:
        fake_flash_plan(&bench.flash, (struct fake_cut){1u + random_below(3), (uint8_t)random_below(FAKE_TEAR_COUNT),
                                                        (uint8_t)random_below(33)});
        break;
    case 3: /* the running application enters the bootloader */
        if (bench.running != BENCH_NO_SLOT) {
            bench.stay_flag = true;
            bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
        }
        break;
    default:
        send_random_packet();
        break;
    }
    if (bench.running != BENCH_NO_SLOT && random_below(4)) {
        bench.stay_flag = true;
        bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
    }
}

/* Check that the confirmed image is unchanged, that no forbidden row was written, and that after a power-on a
 * complete image starts: at last the confirmed one, if another image hangs. */
static void check_invariants(void)
{
    struct fake_flash before = bench.flash;
    CHECK_EQUAL(bench.forbidden_writes, 0);
    CHECK(!bench.refuses_i2c_writes);
    CHECK(bench_holds(&bench, &image));
    fake_flash_plan(&bench.flash, (struct fake_cut){0});
    bench.stay_flag = false;
    bench_reset(&bench, TAXEL_RESET_CAUSE_POWER_ON);
    bench_settle(&bench);
    bool is_whole = bench.running == image.slot;
    for (unsigned i = 0; i < OTHERS && bench.running == (image.slot ^ 1u); i++) {
        is_whole |= bench_holds(&bench, &others[i]);
    }
    CHECK(is_whole);
    for (unsigned i = 0; i < TAXEL_BOOT_TRIES; i++) { /* another image hangs */
        bench_reset(&bench, TAXEL_RESET_CAUSE_WATCHDOG);
        bench_settle(&bench);
    }
    CHECK_EQUAL(bench.running, image.slot);
    bench.flash = before;
}

/* Execute many random actions on a board with this layout of the flash and a confirmed image in `slot`, and check
 * the invariants in between. */
static void fuzz(const struct taxel_boot_layout *layout, uint8_t slot)
{
    bench_init(&bench, layout, seed);
    bench_make_image(&image, layout, slot, 3, 1, seed);
    bench_install(&bench, &image, true);
    for (unsigned i = 0; i < OTHERS; i++) {
        bench_make_image(&others[i], layout, slot ^ 1u, 2u + i / 2u, 2, seed + 1u + i);
    }
    bench.flash.power = &power;
    for (volatile unsigned i = 0; i < packets; i++) {
        if (setjmp(power)) {
            bench_reset(&bench, TAXEL_RESET_CAUSE_BROWN_OUT);
        } else {
            step();
        }
        if (i % 64u == 0) {
            check_invariants();
            bench.stay_flag = true;
            bench_reset(&bench, TAXEL_RESET_CAUSE_COMMAND);
        }
    }
    for (unsigned row = 0; row < FAKE_FLASH_ROWS; row++) {
        const bool is_free = row - layout->first_rows[slot ^ 1u] < layout->slot_rows;
        const bool is_record = row >= TAXEL_BOOT_CONFIGURATION_ROW;
        CHECK(is_free || is_record || bench.flash.wear[row] == 0);
    }
    CHECK(bench.flash.operations || bench.flash.cuts);
}

/* fuzz() checks after every 64 actions: the confirmed image is unchanged, no forbidden row was written, and an image
 * starts. */
static void invariants_hold_for_random_packets_to_a_board(void)
{
    fuzz(&taxel_boot_layout_board, 0);
    const uint32_t *const wear = bench.flash.wear;
    printf("  %u cuts; writes of slot B's first row %u, of the configuration %u, of the metadata %u\n",
           bench.flash.cuts, wear[128], wear[252] + wear[253], wear[254] + wear[255]);
}

static void invariants_hold_for_random_packets_to_the_hub(void)
{
    fuzz(&taxel_boot_layout_hub, 1);
}

/* Run the tests (arguments: number of random actions, seed) and print the command that replays the run. Exit status 1
 * after a failure. */
int main(int argc, char **argv)
{
    packets = argc > 1 ? (unsigned)strtoul(argv[1], NULL, 0) : packets;
    seed = argc > 2 ? strtoull(argv[2], NULL, 0) : seed;
    random_init(&random_actions, seed, 1);
    printf("replay: test_bootloader_fuzz %u %llu\n", packets, (unsigned long long)seed);
    RUN(invariants_hold_for_random_packets_to_a_board);
    RUN(invariants_hold_for_random_packets_to_the_hub);
    return check_summary();
}
