/* The hub's UART: random input, too much input, and slow output. */
#include "check.h"
#include "codec/encoder.h"
#include "emulator/base/random.h"
#include "fake_hub.h"

#define FIRST 0x20

static struct fake_hub fake;
static struct fake_sensor sensors[4];

/* Start a hub that streams from this number of boards. */
static void begin(size_t boards)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, boards);
    CHECK(fake_hub_start(&fake));
}

/* Check that counters balance and no frame or byte is lost, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    CHECK_EQUAL(fake.deframer.discarded_bytes, 0);
    fake_hub_free_boards(&fake);
}

static void random_bytes_between_commands_lose_no_command(void)
{
    struct random_source random;
    uint8_t noise[200];
    random_init(&random, 5, 0);
    begin(2);
    const uint32_t commands = fake.hub.inbox.commands;
    for (unsigned round = 0; round < 300; round++) {
        const size_t size = random_u64(&random) % sizeof noise;
        for (size_t i = 0; i < size; i++) {
            noise[i] = (uint8_t)random_u64(&random);
        }
        fake_hub_receive(&fake, noise, size);
        fake_hub_forget_frames(&fake);
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    }
    CHECK_EQUAL(fake.hub.inbox.commands - commands, 300);
    end();
}

static void frames_of_the_hub_are_not_accepted_as_commands(void)
{
    const uint8_t status[TAXEL_REPLY_HEADER_SIZE] = {1, TAXEL_COMMAND_REBOOT, 0};
    begin(1);
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_REPLY, status, sizeof status);
    fake_hub_run(&fake, 10000);
    CHECK_EQUAL(fake.restarts, 0);
    end();
}

static void a_command_with_a_flipped_bit_is_not_executed(void)
{
    const uint8_t payload[2] = {1, TAXEL_COMMAND_REBOOT};
    uint8_t bytes[64], damaged[64];
    struct taxel_encoder encoder;
    taxel_encoder_begin(&encoder, bytes, sizeof bytes, 0, TAXEL_FRAME_TYPE_COMMAND, 0, sizeof payload);
    taxel_encoder_put(&encoder, payload, sizeof payload);
    const size_t size = taxel_encoder_end(&encoder);
    begin(1);
    for (size_t bit = 8; bit < 8u * (size - 1u); bit++) {
        memcpy(damaged, bytes, size);
        damaged[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        fake_hub_receive(&fake, damaged, size);
        fake_hub_run(&fake, 1000);
        fake_hub_forget_frames(&fake);
    }
    CHECK_EQUAL(fake.restarts, 0);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    end();
}

static void a_full_receive_ring_discards_bytes_and_counts_them(void)
{
    begin(1);
    for (unsigned i = 0; i < 1000; i++) {
        taxel_hub_on_uart_byte(&fake.hub, (uint8_t)(i | 1u));
    }
    CHECK_EQUAL(fake.hub.inbox.overruns, 1000 - 255);
    const uint8_t zero = 0;
    fake_hub_receive(&fake, &zero, 1);
    fake_hub_receive(&fake, &zero, 1);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    end();
}

static void rts_stops_the_host_while_the_receive_ring_is_nearly_full(void)
{
    begin(1);
    for (unsigned i = 0; i < 255u - TAXEL_HUB_HOLD_SPACE - 1u; i++) {
        taxel_hub_on_uart_byte(&fake.hub, (uint8_t)(i | 1u));
    }
    CHECK(!fake.is_host_held);
    taxel_hub_on_uart_byte(&fake.hub, 1);
    CHECK(fake.is_host_held);
    for (unsigned i = 0; i < TAXEL_HUB_HOLD_SPACE; i++) { /* bytes that the adapter still sends */
        taxel_hub_on_uart_byte(&fake.hub, 0);
    }
    CHECK_EQUAL(fake.hub.inbox.overruns, 0);
    CHECK_EQUAL(fake.hold_changes, 1);
    fake_hub_run(&fake, 1000);
    CHECK(!fake.is_host_held);
    CHECK_EQUAL(fake.hold_changes, 2);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    end();
}

/* While the hub executes a command, it accepts no other command: a host that obeys RTS loses no byte. */
static void a_host_with_flow_control_loses_no_command(void)
{
    static const uint8_t transfer[3] = {TAXEL_COMMAND_I2C_TRANSFER, FIRST, 64};
    static const size_t commands = 200;
    uint8_t bytes[200 * 32];
    size_t size = 0, sent = 0;
    begin(1);
    fake_hub_run(&fake, 1000);
    fake_hub_forget_frames(&fake);
    for (size_t i = 0; i < commands; i++) {
        const uint8_t payload[4] = {(uint8_t)i, transfer[0], transfer[1], transfer[2]};
        struct taxel_encoder encoder;
        taxel_encoder_begin(&encoder, bytes + size, sizeof bytes - size, 0, TAXEL_FRAME_TYPE_COMMAND, 0,
                            sizeof payload);
        taxel_encoder_put(&encoder, payload, sizeof payload);
        size += taxel_encoder_end(&encoder);
    }
    while (sent < size) {
        for (unsigned after = 0; sent < size && (!fake.is_host_held || after < TAXEL_HUB_HOLD_SPACE);
             after += fake.is_host_held) {
            taxel_hub_on_uart_byte(&fake.hub, bytes[sent++]);
        }
        while (fake.is_host_held) {
            fake_hub_run(&fake, 100);
        }
    }
    fake_hub_run(&fake, 500000);
    CHECK_EQUAL(fake.hub.inbox.overruns, 0);
    CHECK(fake.hold_changes > 20);
    CHECK(!fake.is_host_held);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_REPLY), commands);
    end();
}

static void a_hub_without_rts_counts_lost_bytes(void)
{
    begin(1);
    fake.hal.uart_hold = NULL;
    for (unsigned i = 0; i < 300; i++) {
        taxel_hub_on_uart_byte(&fake.hub, 1);
    }
    CHECK_EQUAL(fake.hub.inbox.overruns, 300 - 255);
    CHECK(!fake.is_host_held);
    fake_hub_run(&fake, 1000);
    end();
}

static void a_restarted_hub_lowers_rts(void)
{
    begin(1);
    for (unsigned i = 0; i < 250; i++) {
        taxel_hub_on_uart_byte(&fake.hub, 1);
    }
    CHECK(fake.is_host_held);
    fake_hub_boot(&fake);
    CHECK(!fake.is_host_held);
    fake_hub_free_boards(&fake);
}

static void commands_sent_together_are_executed_in_order(void)
{
    uint8_t bytes[255];
    size_t size = 0;
    begin(2);
    fake_hub_run(&fake, 1000);
    fake_hub_forget_frames(&fake);
    static const uint8_t codes[] = {TAXEL_COMMAND_GET_TIME, TAXEL_COMMAND_SCAN_BUS, TAXEL_COMMAND_STOP,
                                    TAXEL_COMMAND_GET_STATUS, TAXEL_COMMAND_START};
    for (size_t i = 0; i < sizeof codes; i++) {
        const uint8_t payload[2] = {(uint8_t)i, codes[i]};
        struct taxel_encoder encoder;
        taxel_encoder_begin(&encoder, bytes + size, sizeof bytes - size, 0, TAXEL_FRAME_TYPE_COMMAND, 0,
                            sizeof payload);
        taxel_encoder_put(&encoder, payload, sizeof payload);
        size += taxel_encoder_end(&encoder);
    }
    fake_hub_receive(&fake, bytes, size);
    fake_hub_run(&fake, 200000);
    uint8_t answered = 0;
    for (size_t i = 0; i < fake.frame_count; i++) {
        if (fake.frames[i].type == TAXEL_FRAME_TYPE_REPLY) {
            CHECK_EQUAL(fake.frames[i].payload[0], answered);
            CHECK_EQUAL(fake.frames[i].payload[2], 0);
            answered++;
        }
    }
    CHECK_EQUAL(answered, sizeof codes);
    end();
}

/* A ring that is completely full would have the same positions as an empty ring. */
static void the_transmit_ring_is_never_filled_completely(void)
{
    static const uint8_t data[TAXEL_REPLY_HEADER_SIZE + 128] = {1, TAXEL_COMMAND_GET_TIME, 0};
    const size_t around = taxel_encoded_size_max(0); /* overhead of a short frame */
    begin(1);
    fake_hub_run(&fake, 1000);
    fake.drain_bytes = 0;
    for (;;) {
        const size_t free_space = FAKE_RING - taxel_hub_uart_pending(&fake.hub);
        const size_t payload_size = free_space - around;
        if (payload_size <= sizeof data) {
            CHECK(!taxel_hub_try_send(&fake.hub, TAXEL_FRAME_TYPE_REPLY, data, payload_size, NULL, 0));
            CHECK(taxel_hub_try_send(&fake.hub, TAXEL_FRAME_TYPE_REPLY, data, payload_size - 1u, NULL, 0));
            break;
        }
        CHECK(taxel_hub_try_send(&fake.hub, TAXEL_FRAME_TYPE_REPLY, data, 100, NULL, 0));
    }
    CHECK_EQUAL(taxel_hub_uart_pending(&fake.hub), FAKE_RING - 1);
    fake.drain_bytes = FAKE_PULL;
    fake_hub_run(&fake, 1000);
    end();
}

static void a_slow_reader_gets_equally_many_frames_of_every_board(void)
{
    begin(4);
    fake.drain_bytes = 4; /* per pass of the main loop */
    fake_hub_run(&fake, 500000);
    const size_t frames = fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST);
    CHECK(frames > 10);
    for (uint8_t i = 1; i < 4; i++) {
        CHECK_BETWEEN(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, (uint8_t)(FIRST + i)), (double)frames - 2,
                      (double)frames + 2);
    }
    end();
}

/* Taxel frames are shorter than a status frame, so that they fit into the free space earlier. */
static void a_status_report_ends_although_the_uart_is_full(void)
{
    for (size_t drained = 1; drained <= 16; drained++) {
        begin(4);
        fake.drain_bytes = drained; /* per pass of the main loop */
        fake_hub_run(&fake, 300000);
        fake_hub_forget_frames(&fake);
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_STATUS, NULL, 0), 0);
        CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_STATUS), 4);
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_STOP, NULL, 0), 0);
        end();
    }
}

int main(void)
{
    RUN(random_bytes_between_commands_lose_no_command);
    RUN(frames_of_the_hub_are_not_accepted_as_commands);
    RUN(a_command_with_a_flipped_bit_is_not_executed);
    RUN(a_full_receive_ring_discards_bytes_and_counts_them);
    RUN(rts_stops_the_host_while_the_receive_ring_is_nearly_full);
    RUN(a_host_with_flow_control_loses_no_command);
    RUN(a_hub_without_rts_counts_lost_bytes);
    RUN(a_restarted_hub_lowers_rts);
    RUN(commands_sent_together_are_executed_in_order);
    RUN(the_transmit_ring_is_never_filled_completely);
    RUN(a_slow_reader_gets_equally_many_frames_of_every_board);
    RUN(a_status_report_ends_although_the_uart_is_full);
    return check_summary();
}
