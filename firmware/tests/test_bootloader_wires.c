/* Packets over I2C and UART: traffic of the hub, noise, and reads before the response is ready. */
#include "check.h"
#include "test_bootloader_bench.h"

static struct bench bench;
static uint8_t packet[TAXEL_BOOT_PACKET_MAX], response[TAXEL_BOOT_PACKET_MAX];
static unsigned packet_size;

/* Prepare a bootloader with this layout of the flash, and a packet with the command ENTER. */
static void boot(const struct taxel_boot_layout *layout)
{
    bench_init(&bench, layout, 4);
    packet_size = bench_packet(&bench, TAXEL_BOOT_COMMAND_ENTER, NULL, 0, packet);
}

/* Write bytes to the bootloader by I2C; each must be acknowledged. */
static void write_bytes(const uint8_t *bytes, unsigned size)
{
    CHECK(taxel_boot_i2c_on_address(&bench.i2c, false));
    for (unsigned i = 0; i < size; i++) {
        CHECK(taxel_boot_i2c_on_write(&bench.i2c, bytes[i]));
    }
    taxel_boot_i2c_on_stop(&bench.i2c);
}

/* Read bytes from the bootloader by I2C. Returns whether the address was acknowledged. */
static bool read_bytes(uint8_t *bytes, unsigned size)
{
    const bool acknowledged = taxel_boot_i2c_on_address(&bench.i2c, true);
    for (unsigned i = 0; i < size && acknowledged; i++) {
        bytes[i] = taxel_boot_i2c_on_read(&bench.i2c);
    }
    taxel_boot_i2c_on_stop(&bench.i2c);
    return acknowledged;
}

/* Return whether all bytes are FF, which means that no response is ready. */
static bool is_all_ff(const uint8_t *bytes, unsigned size)
{
    bool all = true;
    for (unsigned i = 0; i < size; i++) {
        all &= bytes[i] == 0xFF;
    }
    return all;
}

static void reads_give_ff_until_the_response_is_ready(void)
{
    boot(&taxel_boot_layout_board);
    CHECK(read_bytes(response, sizeof response) && is_all_ff(response, sizeof response));
    write_bytes(packet, packet_size);
    CHECK(read_bytes(response, sizeof response) && is_all_ff(response, sizeof response));
    CHECK(!taxel_boot_i2c_on_address(&bench.i2c, false)); /* one packet at a time */
    taxel_boot_i2c_on_stop(&bench.i2c);
    bench_run(&bench);
    CHECK(read_bytes(response, sizeof response));
    CHECK_EQUAL(response[0], 1);
    CHECK(is_all_ff(response + 15, sizeof response - 15));
}

static void a_response_that_becomes_ready_during_a_read_is_not_mixed_in(void)
{
    boot(&taxel_boot_layout_board);
    write_bytes(packet, packet_size);
    CHECK(taxel_boot_i2c_on_address(&bench.i2c, true));
    for (unsigned i = 0; i < 20; i++) {
        CHECK_EQUAL(taxel_boot_i2c_on_read(&bench.i2c), 0xFF);
        bench_run(&bench);
    }
    taxel_boot_i2c_on_stop(&bench.i2c);
    CHECK(read_bytes(response, 15) && response[0] == 1 && response[14] == 0x17);
}

static void writes_meant_for_an_application_are_ignored(void)
{
    static const uint8_t writes[][3] = {{TAXEL_REGISTER_IDENTITY},
                                        {TAXEL_REGISTER_SNAPSHOT},
                                        {TAXEL_REGISTER_CLOCK},
                                        {TAXEL_REGISTER_COMMAND, 5, 0xFA},
                                        {TAXEL_REGISTER_SETTINGS, 1, 2}};
    uint8_t again[64];
    boot(&taxel_boot_layout_board);
    write_bytes(packet, packet_size);
    bench_run(&bench);
    CHECK(read_bytes(response, sizeof response));
    for (unsigned i = 0; i < sizeof writes / sizeof writes[0]; i++) {
        write_bytes(NULL, 0); /* a probe */
        write_bytes(writes[i], i < 3 ? 1 : 3);
        bench_run(&bench);
        CHECK(read_bytes(again, sizeof again));
        CHECK_BYTES(again, response, sizeof again);
    }
}

static void a_packet_interrupted_by_a_bus_error_is_discarded(void)
{
    boot(&taxel_boot_layout_board);
    CHECK(taxel_boot_i2c_on_address(&bench.i2c, false));
    for (unsigned i = 0; i < 5; i++) {
        CHECK(taxel_boot_i2c_on_write(&bench.i2c, packet[i]));
    }
    taxel_boot_i2c_on_bus_error(&bench.i2c);
    taxel_boot_i2c_on_stop(&bench.i2c);
    bench_run(&bench);
    CHECK(read_bytes(response, sizeof response) && is_all_ff(response, sizeof response));
    write_bytes(packet, packet_size);
    bench_run(&bench);
    CHECK(read_bytes(response, sizeof response) && response[0] == 1 && response[1] == 0);
}

static void bytes_beyond_the_longest_packet_are_not_acknowledged(void)
{
    boot(&taxel_boot_layout_board);
    CHECK(taxel_boot_i2c_on_address(&bench.i2c, false));
    for (unsigned i = 0; i < 300; i++) {
        CHECK_EQUAL(taxel_boot_i2c_on_write(&bench.i2c, 1), i < TAXEL_BOOT_PACKET_MAX);
    }
    taxel_boot_i2c_on_stop(&bench.i2c);
    bench_run(&bench);
    CHECK(read_bytes(response, sizeof response) && response[1] == TAXEL_BOOT_STATUS_LENGTH);
}

static void a_repeated_start_ends_a_packet_too(void)
{
    boot(&taxel_boot_layout_board);
    CHECK(taxel_boot_i2c_on_address(&bench.i2c, false));
    for (unsigned i = 0; i < packet_size; i++) {
        CHECK(taxel_boot_i2c_on_write(&bench.i2c, packet[i]));
    }
    CHECK(read_bytes(response, 1));
    CHECK_EQUAL(response[0], 0xFF);
    bench_run(&bench);
    CHECK(read_bytes(response, sizeof response) && response[1] == 0);
}

static void a_board_without_configuration_uses_the_default_address(void)
{
    boot(&taxel_boot_layout_board);
    CHECK_EQUAL(taxel_boot_i2c_address(&bench.config.flash), TAXEL_BOOT_DEFAULT_ADDRESS);
}

/* Send bytes to the bootloader by UART. Returns the status of the response, or BENCH_NO_REPLY. */
static unsigned uart_send(const uint8_t *bytes, unsigned size)
{
    const unsigned taken = bench_exchange(&bench, bytes, size, response);
    return taken ? response[1] : BENCH_NO_REPLY;
}

/* The noise contains every byte except the start byte of a packet, 01. */
static void noise_before_a_packet_on_the_uart_is_ignored(void)
{
    uint8_t noise[255];
    boot(&taxel_boot_layout_hub);
    for (unsigned i = 0; i < sizeof noise; i++) {
        noise[i] = (uint8_t)(i + 1u == 1u ? 0 : i + 1u);
    }
    CHECK_EQUAL(uart_send(noise, sizeof noise), BENCH_NO_REPLY);
    CHECK_EQUAL(uart_send(packet, packet_size), 0);
}

static void an_incomplete_packet_is_discarded_after_silence(void)
{
    boot(&taxel_boot_layout_hub);
    for (unsigned part = 1; part < packet_size; part++) {
        CHECK_EQUAL(uart_send(packet, part), BENCH_NO_REPLY);
        bench.clock_us += TAXEL_BOOT_GAP_US + 1u;
        CHECK_EQUAL(uart_send(packet, packet_size), 0);
    }
}

static void an_impossible_length_is_answered_at_once(void)
{
    const uint8_t bytes[4] = {1, TAXEL_BOOT_COMMAND_SEND_DATA, 58, 0};
    boot(&taxel_boot_layout_hub);
    CHECK_EQUAL(uart_send(bytes, sizeof bytes), TAXEL_BOOT_STATUS_LENGTH);
    CHECK_EQUAL(uart_send(packet, packet_size), BENCH_NO_REPLY); /* may be a part of the invalid packet */
    bench.clock_us += TAXEL_BOOT_GAP_US + 1u;
    CHECK_EQUAL(uart_send(packet, packet_size), 0);
}

int main(void)
{
    RUN(reads_give_ff_until_the_response_is_ready);
    RUN(a_response_that_becomes_ready_during_a_read_is_not_mixed_in);
    RUN(writes_meant_for_an_application_are_ignored);
    RUN(a_packet_interrupted_by_a_bus_error_is_discarded);
    RUN(bytes_beyond_the_longest_packet_are_not_acknowledged);
    RUN(a_repeated_start_ends_a_packet_too);
    RUN(a_board_without_configuration_uses_the_default_address);
    RUN(noise_before_a_packet_on_the_uart_is_ignored);
    RUN(an_incomplete_packet_is_discarded_after_silence);
    RUN(an_impossible_length_is_answered_at_once);
    return check_summary();
}
