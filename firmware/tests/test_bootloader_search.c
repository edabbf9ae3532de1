/* Blank boards share one address. The bus carries the AND of their bytes and the OR of their acknowledges. */
#include "check.h"
#include "test_bootloader_bench.h"

#define BOARDS 17u
#define SEED 21u

static struct bench boards[BOARDS];
static uint8_t addresses[BOARDS]; /* as of the last reset: a slave's address changes only at a reset */
static unsigned questions;

/* Write bytes to all boards that have this I2C address and acknowledge it. */
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

/* Read bytes from all boards at this address, as the AND of their responses. Returns whether a board acknowledged. */
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

/* Send a command to all boards at this I2C address and read the AND of their responses. Returns whether a board
 * acknowledged the read. */
static bool send(uint8_t address, uint8_t command, const uint8_t *data, unsigned size, uint8_t *response)
{
    uint8_t packet[TAXEL_BOOT_PACKET_MAX];
    write_bus(address, packet, bench_packet(&boards[0], command, data, size, packet));
    return read_bus(address, response, TAXEL_BOOT_PACKET_MAX);
}

/* Send the command SEARCH for unique ids that begin with these bits. Writes the AND of all responses to `response`.
 * Returns whether a board responded. */
static bool search(unsigned bits, const uint8_t *prefix, uint8_t *response)
{
    uint8_t data[TAXEL_BOOT_SEARCH_ARGUMENTS_SIZE] = {(uint8_t)bits};
    memcpy(data + 1, prefix, 8);
    questions++;
    return send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_SEARCH, data, sizeof data, response);
}

/* Read a number of 8 bytes, most significant byte first. */
static uint64_t big_endian(const uint8_t *bytes)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < 8; i++) {
        value = (value << 8) | bytes[i];
    }
    return value;
}

/* Write a number as 8 bytes, most significant byte first. */
static void put_big_endian(uint8_t *bytes, uint64_t value)
{
    for (unsigned i = 0; i < 8; i++) {
        bytes[i] = (uint8_t)(value >> (56u - 8u * i));
    }
}

/* Write the unique ids that begin with these bits to ids[], in ascending order, from the replies to searches: bit by
 * bit, a reply states whether all selected boards have a 1, or all a 0. Returns the number of ids. */
static unsigned find_ids(unsigned bits, uint64_t prefix, uint64_t *ids)
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
        ids[0] = ones;
        return bits == 64 ? 1u : find_ids(64, ones, ids);
    }
    const uint64_t common = split ? ones & ~(~0ull >> split) : 0;
    const unsigned count = find_ids(split + 1u, common, ids);
    return count + find_ids(split + 1u, common | (1ull << (63u - split)), ids + count);
}

/* Find the unique ids that begin with these bits from the acknowledges of searches alone, and write them to ids[]
 * in ascending order. Returns their number. */
static unsigned find_ids_by_acknowledge(unsigned bits, uint64_t prefix, uint64_t *ids)
{
    uint8_t id[8], response[TAXEL_BOOT_PACKET_MAX];
    put_big_endian(id, prefix);
    if (!search(bits, id, response)) {
        return 0;
    }
    if (bits == 64) {
        ids[0] = prefix;
        return 1;
    }
    const unsigned count = find_ids_by_acknowledge(bits + 1u, prefix, ids);
    return count + find_ids_by_acknowledge(bits + 1u, prefix | (1ull << (63u - bits)), ids + count);
}

/* Start all boards without configuration, with the unique ids that `id_of` returns. */
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

/* Return a random unique id. */
static uint64_t random_id(struct random_source *random, unsigned board)
{
    (void)board;
    return random_u64(random);
}

/* Return the unique id of one of many chips from the same wafer, which differ in few bits. */
static uint64_t id_of_one_wafer(struct random_source *random, unsigned board)
{
    (void)random;
    return 0x0123456700001000ull + board;
}

/* Return a unique id whose set bits are also set in the id of the next board, so that the AND of two ids is an existing
 * id. */
static uint64_t id_that_is_a_prefix_of_the_next(struct random_source *random, unsigned board)
{
    (void)random;
    return (1ull << (3u * board)) - 1u; /* the set bits of each id are also set in the next id */
}

/* Return whether the id of this board is among `count` ids. */
static bool has_id(const uint64_t *ids, unsigned count, const struct bench *board)
{
    for (unsigned i = 0; i < count; i++) {
        if (ids[i] == big_endian(board->unique_id)) {
            return true;
        }
    }
    return false;
}

/* Check that searches find the unique ids of all boards, in ascending order and with the permitted number of
 * commands. */
static void check_all_ids_found(uint64_t (*id_of)(struct random_source *random, unsigned board))
{
    uint64_t ids[BOARDS + 1u];
    boot(id_of);
    CHECK_EQUAL(find_ids(0, 0, ids), BOARDS);
    CHECK(questions <= 2u * BOARDS - 1u + BOARDS);
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK(has_id(ids, BOARDS, &boards[i]));
        CHECK(i == 0 || ids[i - 1u] < ids[i]);
    }
    boot(id_of);
    CHECK_EQUAL(find_ids_by_acknowledge(0, 0, ids), BOARDS);
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK(has_id(ids, BOARDS, &boards[i]));
    }
}

static void searches_find_the_unique_id_of_every_board(void)
{
    check_all_ids_found(random_id);
    check_all_ids_found(id_of_one_wafer);
    check_all_ids_found(id_that_is_a_prefix_of_the_next);
}

static void a_board_that_is_not_selected_does_not_respond(void)
{
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
    boot(random_id);
    CHECK(search(64, boards[3].unique_id, response));
    CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_ENTER, NULL, 0, response));
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK_EQUAL(boards[i].boot.entered, i == 3u);
    }
    CHECK(search(0, boards[3].unique_id, response)); /* selects all boards again */
    CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_ENTER, NULL, 0, response));
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK(boards[i].boot.entered);
    }
}

static void a_search_for_more_than_64_bits_is_rejected(void)
{
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
    boot(random_id);
    CHECK(search(65, boards[0].unique_id, response));
    CHECK_EQUAL(response[1], TAXEL_BOOT_STATUS_DATA);
}

static void each_board_gets_a_unique_address(void)
{
    uint64_t ids[BOARDS + 1u];
    uint8_t response[TAXEL_BOOT_PACKET_MAX];
    boot(random_id);
    CHECK_EQUAL(find_ids(0, 0, ids), BOARDS);
    for (unsigned i = 0; i < BOARDS; i++) {
        uint8_t data[TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_SIZE] = {0};
        put_big_endian(data, ids[i]);
        data[8] = TAXEL_BOOT_VERSION;
        data[9] = (uint8_t)(0x20u + i);
        data[10] = 1;
        CHECK(search(64, data, response));
        CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_ENTER, NULL, 0, response) && response[1] == 0);
        CHECK(send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_WRITE_CONFIGURATION, data, sizeof data, response) &&
              response[1] == 0);
        (void)send(TAXEL_BOOT_DEFAULT_ADDRESS, TAXEL_BOOT_COMMAND_EXIT, NULL, 0, response);
    }
    CHECK(!search(0, boards[0].unique_id, response)); /* no board uses the default address any more */
    for (unsigned i = 0; i < BOARDS; i++) {
        CHECK_EQUAL(boards[i].flash.operations, 1);
        CHECK(send((uint8_t)(0x20u + i), TAXEL_BOOT_COMMAND_GET_INFO, NULL, 0, response));
        CHECK_EQUAL(big_endian(response + 4 + TAXEL_BOOT_INFO_OFFSET_UNIQUE_ID), ids[i]);
    }
}

int main(void)
{
    printf("seed %u\n", SEED);
    RUN(searches_find_the_unique_id_of_every_board);
    RUN(a_board_that_is_not_selected_does_not_respond);
    RUN(a_search_for_more_than_64_bits_is_rejected);
    RUN(each_board_gets_a_unique_address);
    return check_summary();
}
