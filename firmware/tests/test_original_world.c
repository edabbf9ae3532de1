/* The firmware of the original hub and boards on the emulated bus, UART and front end, and the world-file line that
 * selects it. */
#define _GNU_SOURCE
#include <stdlib.h>

#include "check.h"
#include "codec/crc32.h"
#include "emulator/physics/layer.h"
#include "emulator/world.h"
#include "rejection.h"

#define STREAM_MAX (1u << 18)
#define MESSAGES_MAX 8192u

struct board_kind {
    uint8_t address, taxels;
};

/* The 22 boards of the first generation in the read order of the hub, 224 taxels. */
static const struct board_kind first_generation[] = {
    {0x17, 14}, {0x18, 6},  {0x19, 6},  {0x1A, 6}, {0x1B, 15}, {0x1C, 14}, {0x1D, 6},  {0x08, 6},
    {0x09, 6},  {0x0A, 15}, {0x0B, 14}, {0x0C, 6}, {0x0D, 6},  {0x0E, 6},  {0x0F, 15}, {0x10, 14},
    {0x11, 6},  {0x12, 6},  {0x13, 6},  {0x14, 6}, {0x15, 20}, {0x16, 25},
};

/* The 15 boards of the thesis's hand that its host kept, 905 taxels. */
static const struct board_kind thesis_hand[] = {
    {0x18, 27}, {0x19, 65}, {0x1A, 30}, {0x1B, 78}, {0x1C, 66}, {0x1D, 27},  {0x08, 65},  {0x09, 30},
    {0x0A, 78}, {0x0C, 27}, {0x0D, 65}, {0x0E, 30}, {0x0F, 78}, {0x15, 121}, {0x16, 118},
};

static struct world_description description;
static struct world world;
static struct stimulus stimulus;
static struct endpoint endpoint;
static struct host_script script;
static uint8_t stream[STREAM_MAX];
static size_t stream_size;

/* The messages of the stream: address, number of taxels, position of the first count. */
static struct {
    uint8_t address, taxels;
    size_t counts;
} messages[MESSAGES_MAX];
static size_t message_count;

/* Describe a world with the original firmware and its clock rates; tests may change the description afterwards. */
static void describe(const struct board_kind *kinds, size_t count)
{
    memset(&description, 0, sizeof description);
    description.seed = 1;
    description.scl_hz = ORIGINAL_SCL_HZ;
    description.baud = ORIGINAL_BAUD;
    description.usb_latency_ms = 1.0;
    description.usb_latency_down_ms = 1.0;
    description.noise_counts = 3.0;
    description.scan = (struct taxel_scan_settings)ORIGINAL_SCAN_SETTINGS;
    description.layer_thickness = 0.001;
    description.board_count = count;
    original_settings_set_defaults(&description.original);
    for (size_t i = 0; i < count; i++) {
        struct board_description *board = &description.boards[i];
        board->address = kinds[i].address;
        board->kind = 1;
        board->columns = kinds[i].taxels < 16 ? kinds[i].taxels : 16;
        board->rows = (uint8_t)((kinds[i].taxels + 15u) / 16u);
        board->taxel_count = kinds[i].taxels;
        for (unsigned crossing = 0; crossing < kinds[i].taxels; crossing++) {
            board->crossing_map[crossing >> 3] |= (uint8_t)(1u << (crossing & 7u));
        }
        board->unique_id[0] = board->address;
        board->boot_ms = 5.0;
        board->bracket_offset = frame_identity;
    }
}

/* Select the settings with which the thesis's hand reaches the limit of its UART. */
static void use_thesis_settings(void)
{
    description.original.delay_ms = 0.0;
    description.original.is_paced = false;
    description.original.ring_size = 256;
}

/* Start the described world. `with_counts`: the raw counts are those of set_counts(), otherwise those of the front
 * end. */
static void open_world(bool with_counts)
{
    layer_init();
    stream_size = 0;
    memset(&script, 0, sizeof script);
    script.next = VTIME_NEVER;
    CHECK(!original_settings_complete(&description.original, description.boards, description.board_count, "test"));
    CHECK(!stimulus_open(&stimulus, -1, "test", world_taxel_count(&description), false));
    stimulus.kind = with_counts ? STIMULUS_COUNTS : STIMULUS_FORCE;
    CHECK(!endpoint_open(&endpoint, "memory", description.baud));
    CHECK(!world_init(&world, &description, &stimulus, &endpoint, &script));
}

/* Release what open_world() has opened. */
static void close_world(void)
{
    world_free(&world);
    endpoint_close(&endpoint);
    stimulus_close(&stimulus);
}

/* Run the world for a time in seconds, and append the bytes sent to the stream. */
static void run_s(double seconds)
{
    CHECK(!world_run(&world, world.now + (vtime)(seconds * (double)VTIME_SECOND)));
    stream_size += endpoint_read_memory(&endpoint, stream + stream_size, STREAM_MAX - stream_size);
}

/* Set the raw counts of all taxels from now on: `base` plus the index of the taxel in the world. */
static void set_counts(unsigned base)
{
    static float values[4096];
    for (size_t i = 0; i < world_taxel_count(&description); i++) {
        values[i] = (float)(base + i);
    }
    CHECK(!world_set_stimulus(&world, values));
}

/* Find the messages of an undamaged stream, which may end within a message. */
static void find_messages(void)
{
    size_t position = 0;
    message_count = 0;
    while (position + 2u < stream_size && position + stream[position + 1u] <= stream_size) {
        const size_t length = stream[position + 1u];
        if (!CHECK_EQUAL(stream[position], TAXEL_ORIGINAL_START) ||
            !CHECK_EQUAL(stream[position + length - 1u], TAXEL_ORIGINAL_END)) {
            return;
        }
        messages[message_count].address = stream[position + 2u];
        messages[message_count].taxels = (uint8_t)((length - 8u) / 2u);
        messages[message_count++].counts = position + 7u;
        position += length;
    }
}

/* Return the number of messages with this address in the stream. */
static unsigned count_messages(uint8_t address)
{
    unsigned count = 0;
    find_messages();
    for (size_t i = 0; i < message_count; i++) {
        count += messages[i].address == address;
    }
    return count;
}

/* Return the raw count of taxel 0 in the message number `number`, counted from 0, of the board with this address. */
static unsigned first_count_of(uint8_t address, unsigned number)
{
    for (size_t i = 0; i < message_count; i++) {
        if (messages[i].address == address && number-- == 0) {
            return taxel_get_u16(stream + messages[i].counts);
        }
    }
    return 0xFFFFFFFFu;
}

/* Return the number of cycles per second, from the account of the hub. */
static double measure_rate_hz(void)
{
    const struct original_account account = original_hub_measure_cycles(world.hub.original);
    return (double)account.cycles / ((double)account.time / (double)VTIME_SECOND);
}

static void all_boards_are_sent_in_the_order_of_their_lines(void)
{
    describe(first_generation, 22);
    open_world(true);
    set_counts(1000);
    run_s(1.0);
    find_messages();
    CHECK(message_count > 100);
    for (size_t i = 0; i < message_count; i++) {
        CHECK_EQUAL(messages[i].address, first_generation[i % 22].address);
        CHECK_EQUAL(messages[i].taxels, first_generation[i % 22].taxels);
    }
    close_world();
}

static void every_message_contains_the_raw_counts_of_its_board(void)
{
    unsigned first = 1000;
    describe(first_generation, 22);
    open_world(true);
    set_counts(1000);
    run_s(1.0);
    find_messages();
    for (size_t i = 0; i < 22; i++) {
        for (unsigned taxel = 0; taxel < messages[i].taxels; taxel++) {
            CHECK_EQUAL(taxel_get_u16(stream + messages[i].counts + 2u * taxel), first++);
        }
    }
    close_world();
}

static void the_counts_are_one_cycle_old(void)
{
    describe(first_generation, 22);
    open_world(true);
    set_counts(1000);
    run_s(0.35); /* in the delay before a general call */
    CHECK_EQUAL(world.hub.original->state, ORIGINAL_HUB_DELAYS);
    const unsigned before = count_messages(0x17);
    set_counts(2000);
    run_s(0.3);
    CHECK(count_messages(0x17) >= before + 2u);
    CHECK_EQUAL(first_count_of(0x17, before), 1000); /* of the scan that the previous call started */
    CHECK_EQUAL(first_count_of(0x17, before + 1u), 2000);
    close_world();
}

static void a_general_call_starts_a_scan_on_every_board(void)
{
    describe(first_generation, 22);
    open_world(true);
    run_s(0.54);
    for (size_t i = 0; i < 22; i++) {
        CHECK_EQUAL(world.boards[i].original->scans, world.boards[0].original->scans);
    }
    CHECK_BETWEEN(world.boards[0].original->scans, 4, 7);
    close_world();
}

static void at_rest_the_raw_counts_are_near_40_percent_of_full_scale(void)
{
    describe(first_generation, 22);
    open_world(false);
    run_s(0.5);
    find_messages();
    for (size_t i = 0; i < 22; i++) {
        CHECK_BETWEEN(taxel_get_u16(stream + messages[i].counts), 1100, 1900);
    }
    close_world();
}

static void a_taxel_is_converted_in_333_us(void)
{
    describe(first_generation, 22);
    open_world(true);
    CHECK_BETWEEN(world.boards[0].original->conversion_time, 333.3 * VTIME_US, 333.4 * VTIME_US);
    close_world();
}

static void the_first_generation_runs_at_8_to_9_hz(void)
{
    describe(first_generation, 22);
    open_world(true);
    run_s(10.0);
    CHECK_BETWEEN(measure_rate_hz(), 8.5, 9.0);
    close_world();
}

static void the_thesis_hand_runs_at_the_limit_of_its_uart(void)
{
    describe(thesis_hand, 15);
    use_thesis_settings();
    open_world(true);
    run_s(20.0);
    const struct original_account account = original_hub_measure_cycles(world.hub.original);
    CHECK_BETWEEN(measure_rate_hz(), 0.99 * 5.97, 1.01 * 5.97);
    CHECK_BETWEEN((double)account.wire_time / (double)account.time, 0.999, 1.001);
    CHECK_BETWEEN((double)account.wire_bytes / (double)account.cycles, 1929.0, 1931.0);
    close_world();
}

static void a_board_without_power_is_missing_and_returns_with_its_power_in_the_main_variant(void)
{
    describe(first_generation, 22);
    open_world(true);
    run_s(1.0);
    const struct fault_description unplug = {.kind = FAULT_UNPLUG, .address = 0x15};
    const struct fault_description plug = {.kind = FAULT_PLUG, .address = 0x15};
    CHECK(!world_inject_fault(&world, &unplug));
    run_s(1.0);
    const unsigned without_power = count_messages(0x15);
    CHECK_BETWEEN(without_power, 8, 10);
    CHECK_BETWEEN(count_messages(0x16), 16, 19);
    CHECK(!world_inject_fault(&world, &plug));
    run_s(1.0);
    CHECK_BETWEEN(count_messages(0x15) - without_power, 7, 9);
    close_world();
}

static void in_the_branch_variant_a_board_without_power_stays_missing_until_the_hub_restarts(void)
{
    describe(first_generation, 22);
    description.original.variant = ORIGINAL_BRANCH;
    open_world(true);
    const struct fault_description unplug = {.kind = FAULT_UNPLUG, .address = 0x15};
    const struct fault_description plug = {.kind = FAULT_PLUG, .address = 0x15};
    const struct fault_description restart = {.kind = FAULT_HUB_RESTART};
    run_s(0.2);
    CHECK(!world_inject_fault(&world, &unplug));
    run_s(0.3);
    CHECK(!world_inject_fault(&world, &plug));
    const unsigned missing = count_messages(0x15);
    run_s(2.0);
    CHECK_EQUAL(count_messages(0x15), missing);
    stream_size = 0; /* the restart interrupts a message */
    CHECK(!world_inject_fault(&world, &restart));
    (void)endpoint_read_memory(&endpoint, stream, STREAM_MAX);
    run_s(1.0);
    CHECK(world.boards[20].original->reads > 5);
    CHECK(!world.hub.original->is_offline[20]);
    close_world();
}

static void a_held_clock_line_stops_the_hub_for_ever_with_the_fault_wait_for_ever(void)
{
    describe(first_generation, 22);
    description.original.faults = ORIGINAL_WAIT_FOR_EVER;
    open_world(true);
    const struct fault_description hold = {.kind = FAULT_HOLD_SCL, .address = 0x08, .value = 200e3};
    const struct fault_description restart = {.kind = FAULT_HUB_RESTART};
    run_s(0.35);
    CHECK_EQUAL(world.hub.original->state, ORIGINAL_HUB_DELAYS);
    CHECK(!world_inject_fault(&world, &hold));
    run_s(0.5);
    const uint64_t sent = world.uart.bytes_sent;
    run_s(5.0);
    CHECK_EQUAL(world.uart.bytes_sent, sent);
    CHECK(!world_inject_fault(&world, &restart));
    run_s(1.0);
    CHECK(world.uart.bytes_sent > sent + 1000u);
    close_world();
}

static void without_the_fault_wait_for_ever_the_hub_continues_when_the_clock_line_is_released(void)
{
    describe(first_generation, 22);
    open_world(true);
    const struct fault_description hold = {.kind = FAULT_HOLD_SCL, .address = 0x08, .value = 200e3};
    run_s(0.35);
    CHECK(!world_inject_fault(&world, &hold));
    run_s(0.3);
    const uint64_t sent = world.uart.bytes_sent;
    run_s(1.0);
    CHECK(world.uart.bytes_sent > sent + 4000u);
    close_world();
}

static void the_hub_ignores_bytes_of_the_host(void)
{
    static const uint8_t command[16] = {1, 2, 3, 4};
    describe(first_generation, 22);
    open_world(true);
    run_s(0.3);
    CHECK_EQUAL(uart_send_from_host(&world.uart, command, sizeof command, world.now), sizeof command);
    run_s(1.0);
    find_messages();
    CHECK(message_count > 200);
    close_world();
}

/* The original hub has neither RTS nor CTS: while the host does not read, bytes are lost. */
static void a_full_adapter_loses_bytes(void)
{
    describe(first_generation, 22);
    open_world(true);
    const struct fault_description mute = {.kind = FAULT_MUTE, .value = 1.0};
    run_s(0.5);
    CHECK(!world_inject_fault(&world, &mute));
    run_s(2.0);
    CHECK(world.uart.bytes_lost > 1000u);
    CHECK_BETWEEN(measure_rate_hz(), 8.5, 9.0);
    close_world();
}

/* Run the thesis's hand for 2 s with these threads. Returns the CRC-32 of the bytes sent. */
static uint32_t run_and_compute_crc(struct thread_pool *thread_pool)
{
    describe(thesis_hand, 15);
    use_thesis_settings();
    open_world(false);
    world_use_thread_pool(&world, thread_pool);
    run_s(2.0);
    const uint32_t crc = taxel_crc32(0, stream, stream_size);
    close_world();
    return crc;
}

static void a_seed_determines_every_byte_for_any_number_of_threads(void)
{
    static struct thread_pool thread_pool;
    const uint32_t crc = run_and_compute_crc(NULL);
    CHECK_EQUAL(run_and_compute_crc(NULL), crc);
    CHECK(!thread_pool_open(&thread_pool, 3));
    CHECK_EQUAL(run_and_compute_crc(&thread_pool), crc);
    thread_pool_close(&thread_pool);
}

#define MAP_3 "0700000000000000000000000000000000000000000000000000000000000000"
#define MAP_128 "ffffffffffffffffffffffffffffffff00000000000000000000000000000000"
#define ID "0102030405060708"
#define BOARD "board 0x08 1 1 3 3 " MAP_3 " " ID " 0 5\n"
#define BOARD_9 "board 0x09 1 1 3 3 " MAP_3 " " ID " 0 5\n"
#define LARGE_BOARD "board 0x09 1 8 16 128 " MAP_128 " " ID " 0 5\n"
#define WORLD "taxel-world 1\n" BOARD BOARD_9

/* Read a valid world file, which must print no line. */
static void read_text(const char *text)
{
    static struct rejection rejection;
    unsigned lines;
    memset(&description, 0, sizeof description);
    CHECK_EQUAL(rejection_read(&rejection, &description, text, &lines), 0);
    CHECK_EQUAL(lines, 0);
}

static void a_line_without_keys_selects_the_first_generation(void)
{
    read_text(WORLD "protocol original\n");
    CHECK(description.original.is_on && description.original.is_paced);
    CHECK_EQUAL(description.original.variant, ORIGINAL_MAIN);
    CHECK_EQUAL(description.original.ring_size, 128);
    CHECK_BETWEEN(description.original.delay_ms, 50.0, 50.0);
    CHECK_BETWEEN(description.scl_hz, 1e5, 1e5);
    CHECK_BETWEEN(description.baud, 115200.0, 115200.0);
    CHECK_EQUAL(description.scan.sub_conversions * description.scan.sense_clock_divider, 4000);
    CHECK_EQUAL(description.original.list_size, 2);
    CHECK_EQUAL(description.original.list[0].address, 0x08);
    CHECK_EQUAL(description.original.list[0].taxels, 3);
    world_file_free(&description);
}

static void a_world_without_the_line_uses_the_firmware_of_this_project(void)
{
    read_text(WORLD);
    CHECK(!description.original.is_on);
    world_file_free(&description);
}

static void the_keys_of_the_line_set_all_options(void)
{
    read_text(WORLD "protocol original variant=branch message=no_timestamp faults=truncated_taxel,wait_for_ever "
                    "delay_ms=0 pacing=0 ring=256 copy_us=2 scl_hz=400000 baud=57600 order=0x09,8,0x0B:66 "
                    "accelerations=11,0x08\n");
    CHECK_EQUAL(description.original.variant, ORIGINAL_BRANCH);
    CHECK_EQUAL(description.original.message, ORIGINAL_WITHOUT_TIMESTAMP);
    CHECK_EQUAL(description.original.faults, ORIGINAL_TRUNCATED_TAXEL | ORIGINAL_WAIT_FOR_EVER);
    CHECK(!description.original.is_paced);
    CHECK_EQUAL(description.original.ring_size, 256);
    CHECK_BETWEEN(description.original.delay_ms + description.original.copy_us, 2.0, 2.0);
    CHECK_BETWEEN(description.scl_hz, 4e5, 4e5);
    CHECK_BETWEEN(description.baud, 57600.0, 57600.0);
    CHECK_EQUAL(description.original.list_size, 3);
    CHECK_EQUAL(description.original.list[0].address, 0x09);
    CHECK_EQUAL(description.original.list[1].address, 0x08);
    CHECK_EQUAL(description.original.list[2].address, 0x0B);
    CHECK_EQUAL(description.original.list[2].taxels, 66);
    CHECK_EQUAL(description.original.list[2].words, 69);
    CHECK_EQUAL(description.original.list[1].words, 6);
    world_file_free(&description);
}

static void later_lines_override_clock_rates_and_scan_settings(void)
{
    read_text(WORLD "protocol original\nbaud 230400\nscan 160 40 1 16 96\n");
    CHECK_BETWEEN(description.baud, 230400.0, 230400.0);
    CHECK_EQUAL(description.scan.sub_conversions, 160);
    world_file_free(&description);
}

static void invalid_lines_are_rejected_with_one_line(void)
{
    static const char *const texts[] = {
        WORLD "protocol\n",
        WORLD "protocol other\n",
        WORLD "protocol original fast\n",
        WORLD "protocol original speed=3\n",
        WORLD "protocol original delay_ms=\n",
        WORLD "protocol original delay_ms=-1\n",
        WORLD "protocol original delay_ms=nan\n",
        WORLD "protocol original pacing=0.5\n",
        WORLD "protocol original pacing=2\n",
        WORLD "protocol original ring=8\n",
        WORLD "protocol original ring=100.5\n",
        WORLD "protocol original variant=third\n",
        WORLD "protocol original message=short\n",
        WORLD "protocol original faults=rust\n",
        WORLD "protocol original order=\n",
        WORLD "protocol original order=8,8\n",
        WORLD "protocol original order=0x0A\n",
        WORLD "protocol original order=0x0A:0\n",
        WORLD "protocol original order=0x0A:124\n",
        WORLD "protocol original order=0x0A:3x\n",
        WORLD "protocol original order=7\n",
        WORLD "protocol original order=0x0A:121 accelerations=0x0A\n",
        WORLD "protocol original accelerations=5\n",
        WORLD "protocol original accelerations=palm\n",
        WORLD "protocol original order=0x78\n",
        WORLD "protocol original order=eight\n",
        WORLD "protocol original\nblank 8\n",
        "taxel-world 1\n" LARGE_BOARD "protocol original\n",
        "taxel-world 1\nprotocol original\n",
    };
    rejection_check_all(texts, sizeof texts / sizeof texts[0]);
}

int main(void)
{
    RUN(all_boards_are_sent_in_the_order_of_their_lines);
    RUN(every_message_contains_the_raw_counts_of_its_board);
    RUN(the_counts_are_one_cycle_old);
    RUN(a_general_call_starts_a_scan_on_every_board);
    RUN(at_rest_the_raw_counts_are_near_40_percent_of_full_scale);
    RUN(a_taxel_is_converted_in_333_us);
    RUN(the_first_generation_runs_at_8_to_9_hz);
    RUN(the_thesis_hand_runs_at_the_limit_of_its_uart);
    RUN(a_board_without_power_is_missing_and_returns_with_its_power_in_the_main_variant);
    RUN(in_the_branch_variant_a_board_without_power_stays_missing_until_the_hub_restarts);
    RUN(a_held_clock_line_stops_the_hub_for_ever_with_the_fault_wait_for_ever);
    RUN(without_the_fault_wait_for_ever_the_hub_continues_when_the_clock_line_is_released);
    RUN(the_hub_ignores_bytes_of_the_host);
    RUN(a_full_adapter_loses_bytes);
    RUN(a_seed_determines_every_byte_for_any_number_of_threads);
    RUN(a_line_without_keys_selects_the_first_generation);
    RUN(a_world_without_the_line_uses_the_firmware_of_this_project);
    RUN(the_keys_of_the_line_set_all_options);
    RUN(later_lines_override_clock_rates_and_scan_settings);
    RUN(invalid_lines_are_rejected_with_one_line);
    return check_summary();
}
