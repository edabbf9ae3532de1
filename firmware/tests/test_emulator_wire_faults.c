/* Faults at each byte of an I2C transfer and on the UART: delivered frames are intact, and the stream continues. */
#include <string.h>

#include "check.h"
#include "fake_world.h"

#define BOARDS 2
#define TAXELS 12
#define FAULTY 0x21
#define POLL_BYTES (1u + TAXEL_SNAPSHOT_OVERHEAD + 2u * TAXELS) /* address byte and snapshot */

static struct fake_world fake;

/* Run a world with a fault at byte `position` of the board's next transfer, half a second after the start of the
 * stream. second: second value of the fault. */
static void run_with_fault_at(enum fault_kind kind, unsigned position, double second)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake_world_fault_at(&fake, 0.9, kind, FAULTY, position, second);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
    CHECK_EQUAL(fake.world.log.count, 2); /* the injection and the effect */
}

/* Check that the board with the injected fault still streams, that all counters agree, and close the world. */
static void check_stream_continues(void)
{
    const unsigned before = fake.frames_of[FAULTY];
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    CHECK(fake.frames_of[FAULTY] > before + 10);
    CHECK(fake_world_adds_up(&fake));
    CHECK_EQUAL(fake.bad_board_crcs, 0);
    fake_world_close(&fake);
}

static void nack_at_any_byte_of_a_poll_loses_no_frame(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        run_with_fault_at(FAULT_NACK_AT, position, 0);
        const struct taxel_hub_slot *board = fake_world_slot(&fake, FAULTY);
        CHECK_EQUAL(board->nacks + board->crc_errors + board->timeouts + board->bus_errors, 0);
        /* A master never acknowledges the last byte of a poll, except in a poll that first writes the register
         * pointer. */
        CHECK(board->retries <= 1 && (board->retries == 1 || position + 1u == POLL_BYTES));
        check_stream_continues();
    }
}

static void flipped_bit_in_any_byte_of_a_poll_is_detected(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        for (unsigned bit = position % 8u; bit < 8; bit += position ? 8u : 1u) { /* all bits of the address byte */
            run_with_fault_at(FAULT_FLIP_AT, position, bit);
            const struct taxel_hub_slot *board = fake_world_slot(&fake, FAULTY);
            CHECK_EQUAL(board->retries, 1);
            CHECK_EQUAL(board->nacks + board->crc_errors + board->timeouts + board->bus_errors, 0);
            check_stream_continues();
        }
    }
}

static void clock_stretching_times_out_only_beyond_the_limit(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position += 5) {
        run_with_fault_at(FAULT_STRETCH_AT, position, 4000);
        CHECK_EQUAL(fake_world_slot(&fake, FAULTY)->timeouts, 0);
        CHECK_EQUAL(fake.world.hub.hub.bus_recoveries, 0);
        check_stream_continues();
        run_with_fault_at(FAULT_STRETCH_AT, position, 50000);
        CHECK_EQUAL(fake_world_slot(&fake, FAULTY)->timeouts, 1);
        check_stream_continues();
    }
}

static void board_streams_again_after_a_brown_out_in_any_byte(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        run_with_fault_at(FAULT_BROWN_OUT_AT, position, 20);
        CHECK(fake_world_slot(&fake, FAULTY)->last_fault == TAXEL_BOARD_FAULT_RESTARTED ||
              fake_world_slot(&fake, FAULTY)->last_fault == TAXEL_BOARD_FAULT_NACK);
        check_stream_continues();
    }
}

static void lost_arbitration_or_stray_stop_at_any_byte_is_retried(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        for (unsigned kind = FAULT_ARBITRATION_AT; kind <= FAULT_BUS_ERROR_AT; kind++) {
            run_with_fault_at((enum fault_kind)kind, position, 0);
            CHECK_EQUAL(fake_world_slot(&fake, FAULTY)->retries, 1);
            CHECK_EQUAL(fake_world_slot(&fake, FAULTY)->bus_errors, 0);
            check_stream_continues();
        }
    }
}

static void scl_held_low_is_reported_until_its_release(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake_world_fault(&fake, 0.9, FAULT_HOLD_SCL, FAULTY, 100000);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.42), 0);
    CHECK_EQUAL(fake.world.hub.hub.bus_fault, TAXEL_BOARD_FAULT_SCL_STUCK);
    CHECK_EQUAL(fake_world_run(&fake, 0.2), 0);
    CHECK_EQUAL(fake.world.hub.hub.bus_fault, TAXEL_BOARD_FAULT_NONE);
    check_stream_continues();
}

static void two_boards_with_one_address_deliver_no_wrong_count(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake.description.boards[0].address = FAULTY;
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 1.0), 0);
    CHECK_EQUAL(fake.frames_of[FAULTY], 0); /* sequence numbers and clocks differ, so that no CRC matches */
    CHECK_EQUAL(fake.bad_board_crcs, 0);
    fake_world_close(&fake);
}

static void uart_fault_loses_only_the_frames_that_contain_it(void)
{
    static const enum fault_kind kinds[] = {FAULT_UP_FLIP, FAULT_UP_DROP, FAULT_UP_DOUBLE};
    for (unsigned position = 0; position < 60; position++) {
        for (size_t n = 0; n < sizeof kinds / sizeof kinds[0]; n++) {
            fake_world_describe(&fake, BOARDS, TAXELS);
            fake_world_fault_at(&fake, 0.9, kinds[n], 0, position, position % 8u);
            CHECK_EQUAL(fake_world_open(&fake, -1), 0);
            CHECK(fake_world_start(&fake));
            CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
            CHECK(fake.sequence_gaps <= 1);
            CHECK_EQUAL(fake.bad_board_crcs, 0);
            fake_world_close(&fake);
        }
    }
}

static void uart_delay_loses_no_frame(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake_world_fault(&fake, 0.9, FAULT_UP_DELAY, 0, 30);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
    CHECK_EQUAL(fake.sequence_gaps, 0);
    check_stream_continues();
}

/* The hub's CPU is busy while 2,000 bytes arrive: with RTS they wait in the adapter, without RTS they are lost. */
static void flow_control_keeps_bytes_that_the_hub_cannot_receive(void)
{
    static const uint8_t invalid_bytes[2000] = {1};
    for (int wired = 0; wired < 2; wired++) {
        fake_world_describe(&fake, BOARDS, TAXELS);
        fake.description.flow_control = wired != 0;
        fake_world_fault(&fake, 0.9, FAULT_HUB_STALL, 0, 40);
        CHECK_EQUAL(fake_world_open(&fake, -1), 0);
        CHECK(fake_world_start(&fake));
        CHECK_EQUAL(fake_world_run(&fake, 0.4), 0);
        const struct taxel_inbox *inbox = &fake.world.hub.hub.inbox;
        CHECK_EQUAL(uart_send_from_host(&fake.world.uart, invalid_bytes, sizeof invalid_bytes, fake.world.now),
                    sizeof invalid_bytes);
        CHECK_EQUAL(fake_world_run(&fake, 0.02), 0);
        CHECK_EQUAL(fake.world.uart.is_held, wired != 0);
        if (wired) {
            CHECK_EQUAL((uint8_t)(inbox->head - inbox->tail), 255u - TAXEL_HUB_HOLD_SPACE + UART_BYTES_AFTER_HOLD);
            CHECK_EQUAL(UART_RECEIVE_BUFFER_SIZE - uart_host_free_space(&fake.world.uart),
                        sizeof invalid_bytes - 255u + 32u - 3u);
        }
        CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
        CHECK_EQUAL(inbox->overruns, wired ? 0 : sizeof invalid_bytes - 255u);
        CHECK_EQUAL(uart_host_free_space(&fake.world.uart), UART_RECEIVE_BUFFER_SIZE);
        CHECK(!fake.world.uart.is_held);
        check_stream_continues();
    }
}

/* The latency applies to each byte, not only to the first of a sequence. */
static void usb_latency_towards_the_hub_delays_every_byte(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake.description.usb_latency_down_ms = 16.0;
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    struct uart *uart = &fake.world.uart;
    CHECK_EQUAL(fake_world_run(&fake, 0.1), 0);
    for (int i = 0; i < 8; i++) {
        CHECK_EQUAL(uart_send_from_host(uart, (const uint8_t[100]){0}, 100, fake.world.now), 100);
        CHECK_EQUAL(fake_world_run(&fake, 0.002), 0);
        CHECK_EQUAL(UART_RECEIVE_BUFFER_SIZE - uart_host_free_space(uart), 100 * (i + 1));
    }
    CHECK_EQUAL(fake_world_run(&fake, 0.0005), 0); /* 16.5 ms after the first packet: half of its bytes have arrived */
    CHECK_BETWEEN(UART_RECEIVE_BUFFER_SIZE - uart_host_free_space(uart), 748, 752);
    CHECK_EQUAL(fake_world_run(&fake, 0.0134), 0); /* all packets but the last have arrived */
    CHECK_EQUAL(UART_RECEIVE_BUFFER_SIZE - uart_host_free_space(uart), 100);
    fake_world_close(&fake);
}

static void hub_sends_a_handshake_after_a_restart_or_a_power_loss(void)
{
    static const enum fault_kind kinds[] = {FAULT_HUB_RESTART, FAULT_HUB_UNPLUG};
    for (size_t n = 0; n < sizeof kinds / sizeof kinds[0]; n++) {
        fake_world_describe(&fake, BOARDS, TAXELS);
        fake_world_fault(&fake, 0.9, kinds[n], 0, 0);
        if (kinds[n] == FAULT_HUB_UNPLUG) {
            fake_world_fault(&fake, 1.0, FAULT_HUB_PLUG, 0, 0);
        }
        CHECK_EQUAL(fake_world_open(&fake, -1), 0);
        CHECK(fake_world_start(&fake));
        CHECK_EQUAL(fake_world_run(&fake, 0.7), 0);
        CHECK(fake.restarts >= 2); /* after power-up and after the fault */
        CHECK(fake_world_start(&fake));
        const unsigned before = fake.frames_of[FAULTY];
        CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
        CHECK(fake.frames_of[FAULTY] > before + 10);
        CHECK_EQUAL(fake.bad_board_crcs, 0);
        fake_world_close(&fake);
    }
}

static void wrap_around_of_clocks_causes_no_fault(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake.description.boards[0].clock_start_us = 4294967296.0 - 1.0e6;
    fake.description.hub_clock_start_us = 4294967296.0 - 1.2e6;
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 2.0), 0);
    for (uint8_t address = 0x20; address < 0x20 + BOARDS; address++) {
        const struct taxel_hub_slot *board = fake_world_slot(&fake, address);
        CHECK_EQUAL(board->last_fault, TAXEL_BOARD_FAULT_NONE);
        CHECK_EQUAL(board->nacks + board->crc_errors + board->timeouts + board->bus_errors, 0);
    }
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
}

int main(void)
{
    RUN(nack_at_any_byte_of_a_poll_loses_no_frame);
    RUN(flipped_bit_in_any_byte_of_a_poll_is_detected);
    RUN(clock_stretching_times_out_only_beyond_the_limit);
    RUN(board_streams_again_after_a_brown_out_in_any_byte);
    RUN(lost_arbitration_or_stray_stop_at_any_byte_is_retried);
    RUN(scl_held_low_is_reported_until_its_release);
    RUN(two_boards_with_one_address_deliver_no_wrong_count);
    RUN(uart_fault_loses_only_the_frames_that_contain_it);
    RUN(flow_control_keeps_bytes_that_the_hub_cannot_receive);
    RUN(usb_latency_towards_the_hub_delays_every_byte);
    RUN(uart_delay_loses_no_frame);
    RUN(hub_sends_a_handshake_after_a_restart_or_a_power_loss);
    RUN(wrap_around_of_clocks_causes_no_fault);
    return check_summary();
}
