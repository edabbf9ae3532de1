/* Faults at every byte of a transfer and on the UART: what is delivered is whole, and the stream goes on at once. */
#include <string.h>

#include "check.h"
#include "fake_world.h"

#define BOARDS 2
#define TAXELS 12
#define BAD 0x21
#define POLL_BYTES (1u + TAXEL_SNAPSHOT_OVERHEAD + 2u * TAXELS) /* the address and what is read */

static struct fake_world fake;

/* A fault at byte `position` of the board's next transfer, half a second into the stream, and what came of it. */
static void strike(enum fault_kind kind, unsigned position, double second)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake_world_fault_at(&fake, 0.9, kind, BAD, position, second);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
    CHECK_EQUAL(fake.world.log.count, 2); /* armed, and then it struck */
}

static void check_streams_on(void)
{
    const unsigned before = fake.frames_of[BAD];
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    CHECK(fake.frames_of[BAD] > before + 10);
    CHECK(fake_world_adds_up(&fake));
    CHECK_EQUAL(fake.bad_board_crcs, 0);
    fake_world_close(&fake);
}

static void a_nack_at_every_byte_of_a_poll_costs_no_frame(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        strike(FAULT_NACK_AT, position, 0);
        const struct taxel_hub_slot *board = fake_world_slot(&fake, BAD);
        CHECK_EQUAL(board->nacks + board->crc_errors + board->timeouts + board->bus_errors, 0);
        /* The last byte is refused anyway; it is not the last of a poll that writes the pointer first. */
        CHECK(board->retries <= 1 && (board->retries == 1 || position + 1u == POLL_BYTES));
        check_streams_on();
    }
}

static void a_flipped_bit_in_any_byte_of_a_poll_is_found(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        for (unsigned bit = position % 8u; bit < 8; bit += position ? 8u : 1u) { /* of the address all */
            strike(FAULT_FLIP_AT, position, bit);
            const struct taxel_hub_slot *board = fake_world_slot(&fake, BAD);
            CHECK_EQUAL(board->retries, 1);
            CHECK_EQUAL(board->nacks + board->crc_errors + board->timeouts + board->bus_errors, 0);
            check_streams_on();
        }
    }
}

static void a_stretched_byte_costs_time_only_below_the_limit(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position += 5) {
        strike(FAULT_STRETCH_AT, position, 4000);
        CHECK_EQUAL(fake_world_slot(&fake, BAD)->timeouts, 0);
        CHECK_EQUAL(fake.world.hub.hub.bus_recoveries, 0);
        check_streams_on();
        strike(FAULT_STRETCH_AT, position, 50000);
        CHECK_EQUAL(fake_world_slot(&fake, BAD)->timeouts, 1);
        check_streams_on();
    }
}

static void a_board_that_browns_out_in_any_byte_comes_back(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        strike(FAULT_BROWN_OUT_AT, position, 20);
        CHECK(fake_world_slot(&fake, BAD)->last_fault == TAXEL_BOARD_FAULT_RESTARTED ||
              fake_world_slot(&fake, BAD)->last_fault == TAXEL_BOARD_FAULT_NACK);
        check_streams_on();
    }
}

static void a_lost_arbitration_or_a_stray_stop_at_any_byte_is_tried_again(void)
{
    for (unsigned position = 0; position < POLL_BYTES; position++) {
        for (unsigned kind = FAULT_ARBITRATION_AT; kind <= FAULT_BUS_ERROR_AT; kind++) {
            strike((enum fault_kind)kind, position, 0);
            CHECK_EQUAL(fake_world_slot(&fake, BAD)->retries, 1);
            CHECK_EQUAL(fake_world_slot(&fake, BAD)->bus_errors, 0);
            check_streams_on();
        }
    }
}

static void scl_held_low_is_told_and_over_when_it_is_released(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake_world_fault(&fake, 0.9, FAULT_HOLD_SCL, BAD, 100000);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.42), 0);
    CHECK_EQUAL(fake.world.hub.hub.bus_fault, TAXEL_BOARD_FAULT_SCL_STUCK);
    CHECK_EQUAL(fake_world_run(&fake, 0.2), 0);
    CHECK_EQUAL(fake.world.hub.hub.bus_fault, TAXEL_BOARD_FAULT_NONE);
    check_streams_on();
}

static void two_boards_on_one_address_give_no_wrong_count(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake.description.boards[0].address = BAD;
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 1.0), 0);
    CHECK_EQUAL(fake.frames_of[BAD], 0); /* their sequences and clocks differ, so no CRC ever fits */
    CHECK_EQUAL(fake.bad_board_crcs, 0);
    fake_world_close(&fake);
}

static void uart_faults_cost_the_frames_that_they_touch(void)
{
    static const enum fault_kind kinds[] = {FAULT_UP_FLIP, FAULT_UP_DROP, FAULT_UP_DOUBLE};
    for (unsigned place = 0; place < 60; place++) {
        for (size_t n = 0; n < sizeof kinds / sizeof kinds[0]; n++) {
            fake_world_describe(&fake, BOARDS, TAXELS);
            fake_world_fault_at(&fake, 0.9, kinds[n], 0, place, place % 8u);
            CHECK_EQUAL(fake_world_open(&fake, -1), 0);
            CHECK(fake_world_start(&fake));
            CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
            CHECK(fake.sequence_gaps <= 1);
            CHECK_EQUAL(fake.bad_board_crcs, 0);
            fake_world_close(&fake);
        }
    }
}

static void a_delay_loses_nothing(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake_world_fault(&fake, 0.9, FAULT_UP_DELAY, 0, 30);
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    CHECK(fake_world_start(&fake));
    CHECK_EQUAL(fake_world_run(&fake, 0.6), 0);
    CHECK_EQUAL(fake.sequence_gaps, 0);
    check_streams_on();
}

/* The hub's processor is away while 2,000 bytes come: with RTS they wait in the adapter, without it they are lost. */
static void a_held_adapter_keeps_what_the_hub_cannot_take(void)
{
    static const uint8_t rubbish[2000] = {1};
    for (int wired = 0; wired < 2; wired++) {
        fake_world_describe(&fake, BOARDS, TAXELS);
        fake.description.flow_control = wired != 0;
        fake_world_fault(&fake, 0.9, FAULT_HUB_STALL, 0, 40);
        CHECK_EQUAL(fake_world_open(&fake, -1), 0);
        CHECK(fake_world_start(&fake));
        CHECK_EQUAL(fake_world_run(&fake, 0.4), 0);
        const struct taxel_inbox *inbox = &fake.world.hub.hub.inbox;
        CHECK_EQUAL(uart_host_sends(&fake.world.uart, rubbish, sizeof rubbish, fake.world.now), sizeof rubbish);
        CHECK_EQUAL(fake_world_run(&fake, 0.02), 0);
        CHECK_EQUAL(fake.world.uart.holds, wired != 0);
        if (wired) {
            CHECK_EQUAL((uint8_t)(inbox->head - inbox->tail), 255u - TAXEL_HUB_HOLD_ROOM + UART_SENT_AFTER_HOLD);
            CHECK_EQUAL(UART_RECEIVE_BUFFER - uart_host_room(&fake.world.uart), sizeof rubbish - 255u + 32u - 3u);
        }
        CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
        CHECK_EQUAL(inbox->overruns, wired ? 0 : sizeof rubbish - 255u);
        CHECK_EQUAL(uart_host_room(&fake.world.uart), UART_RECEIVE_BUFFER);
        CHECK(!fake.world.uart.holds);
        check_streams_on();
    }
}

/* Bytes that follow others take as long as these: they do not overtake the time that the wire needs. */
static void a_latency_towards_the_hub_delays_every_byte(void)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    fake.description.usb_latency_down_ms = 16.0;
    CHECK_EQUAL(fake_world_open(&fake, -1), 0);
    struct uart *uart = &fake.world.uart;
    CHECK_EQUAL(fake_world_run(&fake, 0.1), 0);
    for (int i = 0; i < 8; i++) {
        CHECK_EQUAL(uart_host_sends(uart, (const uint8_t[100]){0}, 100, fake.world.now), 100);
        CHECK_EQUAL(fake_world_run(&fake, 0.002), 0);
        CHECK_EQUAL(UART_RECEIVE_BUFFER - uart_host_room(uart), 100 * (i + 1));
    }
    CHECK_EQUAL(fake_world_run(&fake, 0.0005), 0); /* 16.5 ms after the first: half of its bytes are through */
    CHECK_BETWEEN(UART_RECEIVE_BUFFER - uart_host_room(uart), 748, 752);
    CHECK_EQUAL(fake_world_run(&fake, 0.0134), 0); /* all but the last packet */
    CHECK_EQUAL(UART_RECEIVE_BUFFER - uart_host_room(uart), 100);
    fake_world_close(&fake);
}

static void a_hub_sends_a_handshake_after_a_restart_or_a_power_loss(void)
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
        CHECK(fake.restarts >= 2); /* power-up, and now */
        CHECK(fake_world_start(&fake));
        const unsigned before = fake.frames_of[BAD];
        CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
        CHECK(fake.frames_of[BAD] > before + 10);
        CHECK_EQUAL(fake.bad_board_crcs, 0);
        fake_world_close(&fake);
    }
}

static void clocks_that_wrap_cost_nothing(void)
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
    RUN(a_nack_at_every_byte_of_a_poll_costs_no_frame);
    RUN(a_flipped_bit_in_any_byte_of_a_poll_is_found);
    RUN(a_stretched_byte_costs_time_only_below_the_limit);
    RUN(a_board_that_browns_out_in_any_byte_comes_back);
    RUN(a_lost_arbitration_or_a_stray_stop_at_any_byte_is_tried_again);
    RUN(scl_held_low_is_told_and_over_when_it_is_released);
    RUN(two_boards_on_one_address_give_no_wrong_count);
    RUN(uart_faults_cost_the_frames_that_they_touch);
    RUN(a_held_adapter_keeps_what_the_hub_cannot_take);
    RUN(a_latency_towards_the_hub_delays_every_byte);
    RUN(a_delay_loses_nothing);
    RUN(a_hub_sends_a_handshake_after_a_restart_or_a_power_loss);
    RUN(clocks_that_wrap_cost_nothing);
    return check_summary();
}
