/* Blank boards share one address. The bus shows the AND of what they say, and the OR of their acknowledges. */
#include "check.h"
#include "test_bootloader_bench.h"

#define BOARDS 17u
#define SEED 21u

static struct bench boards[BOARDS];
static uint8_t addresses[BOARDS]; /* as of the last reset: a slave's address does not move under a master */
static unsigned questions;

static void write_bus(uint8_t address, const uint8_t *bytes, unsigned size)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        struct bench *const board = &boards[i];
        if (board->running == BENCH_NO_SLOT && addresses[i] == address &&
            taxel_boot_i2c_on_address(&board->i2c, false)) {
            for (unsigned k = 0; k < size && taxel_boot_i2c_on_write(&board->i2c, bytes[k]); k++) {
            }
            taxel_boot_i2c_on_stop(&board->i2c);
        }
    }
    for (unsigned i = 0; i < BOARDS; i++) {
        const unsigned restarts = boards[i].restarts;
        bench_run(&boards[i]);
        if (boards[i].restarts != restarts) {
            addresses[i] = taxel_boot_i2c_address(&boards[i].config.flash);
        }
    }
}

/* Returns whether anybody acknowledged. */
static bool read_bus(uint8_t address, uint8_t *bytes, unsigned size)
{
    bool acknowledged = false;
    memset(bytes, 0xFF, size);
    for (unsigned i = 0; i < BOARDS; i++) {
        struct bench *const board = &boards[i];
        if (board->running == BENCH_NO_SLOT && addresses[i] == address &&
            taxel_boot_i2c_on_address(&board->i2c, true)) {
            acknowledged = true;
            for (unsigned k = 0; k < size; k++) {
                bytes[k] &= taxel_boot_i2c_on_read(&board->i2c);
            }
            taxel_boot_i2c_on_stop(&board->i2c);
        }
    }
    return acknowledged;
}

static bool send(uint8_t address, uint8_t command, const uint8_t *data, unsigned size, uint8_t *response)
{
    uint8_t packet[TAXEL_BOOT_PACKET_MAX];
    write_bus(address, packet, bench_packet(&boards[0], command, data, size, packet));
    return read_bus(address, response, TAXEL_BOOT_PACKET_MAX);
}

static bool search(unsigned bits, const uint8_t *prefix, uint8_t *response)
{
    uint8_t data[TAXEL_BOOT_SEARCH_ARGUMENTS_SIZE] = {(uint8_t)bits};
    memcpy(data + 1, prefix, 8);
    questions++;
    return send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_SEARCH, data, sizeof data, response);
}

static uint64_t big_endian(const uint8_t *bytes)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < 8; i++) {
        value = (value << 8) | bytes[i];
    }
    return value;
}

static void put_big_endian(uint8_t *bytes, uint64_t value)
{
    for (unsigned i = 0; i < 8; i++) {
        bytes[i] = (uint8_t)(value >> (56u - 8u * i));
    }
}

/* The ids that begin with these bits, in rising order, to found[]; by what the replies show. Returns how many. */
static unsigned find(unsigned bits, uint64_t prefix, uint64_t *found)
{
    uint8_t id[8], response[TAXEL_BOOT_PACKET_MAX];
    put_big_endian(id, prefix);
    if (!search(bits, id, response)) {
        return 0;
    }
    const uint64_t ones = big_endian(response + 4), zeros = big_endian(response + 12);
    CHECK_EQUAL(ones & zeros, 0);
    unsigned split = 0;
    while (split < 64 && ((ones | zeros) >> (63u - split)) & 1u) {
        split++;
    }
    if (split == 64) {
        found[0] = ones;
        return bits == 64 ? 1u : find(64, ones, found);
    }
    const uint64_t known = split ? ones & ~(~0ull >> split) : 0;
    const unsigned count = find(split + 1u, known, found);
    return count + find(split + 1u, known | (1ull << (63u - split)), found + count);
}

/* The same by acknowledges alone, as if a collision showed nothing. */
static unsigned find_by_acknowledge(unsigned bits, uint64_t prefix, uint64_t *found)
{
    uint8_t id[8], response[TAXEL_BOOT_PACKET_MAX];
    put_big_endian(id, prefix);
    if (!search(bits, id, response)) {
        return 0;
    }
    if (bits == 64) {
        found[0] = prefix;
        return 1;
    }
    const unsigned count = find_by_acknowledge(bits + 1u, prefix, found);
    return count + find_by_acknowledge(bits + 1u, prefix | (1ull << (63u - bits)), found + count);
}

static void boot(uint64_t (*id_of)(struct random_source *random, unsigned board))
{
    struct random_source random;
    random_init(&random, SEED, 0);
    for (unsigned i = 0; i < BOARDS; i++) {
        bench_init(&boards[i], &taxel_boot_layout_board, i);
        put_big_endian(boards[i].unique_id, id_of(&random, i));
        bench_settle(&boards[i]);
        addresses[i] = taxel_boot_i2c_address(&boards[i].config.flash);
    }
    questions = 0;
}

static uint64_t random_id(struct random_source *random, unsigned board)
{
    (void)board;
    return random_u64(random);
}

static uint64_t id_of_one_wafer(struct random_source *random, unsigned board)
{
    (void)random;
    return 0x0123456700001000ull + board;
}

static uint64_t id_within_the_next(struct random_source *random, unsigned board)
{
    (void)random;
    return (1ull << (3u * board)) - 1u; /* each one's bits are also the next one's */
}

static bool has_id(const uint64_t *found, unsigned count, const struct bench *board)
{
    for (unsigned i = 0; i < count; i++) {
        if (found[i] == big_endian(board->unique_id)) {
            return true;
        }
    }
    return false;
}

static void check_found(uint64_t (*id_of)(struct random_source *random, unsigned board))
{
    uint64_t found[BOARDS + 1u];
    boot(id_of);
    CHECK_EQUAL(find(0, 0, found), BOARDS);
    CHECK(questions <= 2u * BOARDS - 1u + BOARDS);
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK(has_id(found, BOARDS, &boards[i]));
        CHECK(i == 0 || found[i - 1u] < found[i]);
    }
    boot(id_of);
    CHECK_EQUAL(find_by_acknowledge(0, 0, found), BOARDS);
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK(has_id(found, BOARDS, &boards[i]));
    }
}

static void every_board_is_found(void)
{
    check_found(random_id);
    check_found(id_of_one_wafer);
    check_found(id_within_the_next);
}

static void a_board_that_is_not_meant_is_deaf_and_dumb(void)
{
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
    boot(random_id);
    CHECK(search(64, boards[3].unique_id, response));
    CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_ENTER, NULL, 0, response));
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK_EQUAL(boards[i].boot.entered, i == 3u);
    }
    CHECK(search(0, boards[3].unique_id, response)); /* all of them again */
    CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_ENTER, NULL, 0, response));
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK(boards[i].boot.entered);
    }
}

static void more_bits_than_an_id_has_are_refused(void)
{
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
    boot(random_id);
    CHECK(search(65, boards[0].unique_id, response));
    CHECK_EQUAL(response[1], TAXEL_BOOT_STATUS_DATA);
}

static void each_board_gets_an_address_of_its_own(void)
{
    uint64_t found[BOARDS + 1u];
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
    boot(random_id);
    CHECK_EQUAL(find(0, 0, found), BOARDS);
    for (unsigned i = 0; i < BOARDS; i++) {
        uint8_t data[TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_SIZE] = {0};
        put_big_endian(data, found[i]);
        data[8] = TAXEL_BOOT_VERSION;
        data[9] = (uint8_t)(0x20u + i);
        data[10] = 1;
        CHECK(search(64, data, response));
        CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_ENTER, NULL, 0, response) && response[1] == 0);
        CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_WRITE_CONFIGURATION, data, sizeof data, response) &&
              response[1] == 0);
        (void)send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_EXIT, NULL, 0, response);
    }
    CHECK(!search(0, boards[0].unique_id, response)); /* nobody is left there */
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK_EQUAL(boards[i].flash.operations, 1);
        CHECK(send((uint8_t)(0x20u + i), TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0, response));
        CHECK_EQUAL(big_endian(response + 4 + TAXEL_BOOT_INFO_OFFSET_UNIQUE_ID), found[i]);
    }
}

int main(void)
{
    printf("seed %u\n", SEED);
    RUN(every_board_is_found);
    RUN(a_board_that_is_not_meant_is_deaf_and_dumb);
    RUN(more_bits_than_an_id_has_are_refused);
    RUN(each_board_gets_an_address_of_its_own);
    return check_summary();
}
