/* Compact snapshots through the hub: it forwards them unparsed, and writes acknowledgements to the boards. */
#include "check.h"
#include "codec/compact_receiver.h"
#include "codec/encoder.h"
#include "fake_hub.h"

#define FIRST 0x20
#define BOARDS 3u
#define TAXELS 10u

static struct fake_hub fake;
static struct fake_sensor sensors[BOARDS];
static struct taxel_compact_receiver receivers[BOARDS];
static taxel_compact_state states[BOARDS][TAXELS];
static uint8_t residuals[BOARDS][TAXELS];
static uint8_t buffers[BOARDS][2][TAXEL_COMPACT_BUFFER_SIZE(TAXELS)];
static unsigned decoded, packed_frames, delta_frames, without_key_frame;
static bool is_host_silent; /* the host sends no acknowledgements */

/* Return the raw count of a taxel without touch: small noise, no escapes. */
static uint16_t count_at_rest(uint16_t scan, uint16_t taxel)
{
    return (uint16_t)(3000u + 20u * taxel + (scan * 40503u + taxel * 9973u) % 65521u % 5u);
}

/* Return the raw count of the conversion in progress of a simulated board without touch. */
static uint16_t count_of(struct fake_sensor *sensor)
{
    return count_at_rest((uint16_t)sensor->sensor.scan.scans, sensor->sensor.scan.taxel);
}

/* Run the main loops of the boards between two transfers; script of the bus. */
static int run_boards(struct fake_hub *hub, const struct taxel_i2c_transfer *transfer)
{
    (void)hub;
    (void)transfer;
    for (size_t i = 0; i < BOARDS; i++) {
        while (taxel_sensor_has_work(&sensors[i].sensor)) {
            taxel_sensor_run(&sensors[i].sensor);
        }
    }
    return FAKE_PROCEED;
}

/* Start board number `i`, which completes one scan. */
static void boot_board(size_t i)
{
    CHECK_EQUAL(fake_sensor_boot(&sensors[i]), 0);
    fake_scan(&sensors[i], 1);
}

/* Start a hub with boards that offer compact snapshots. The last board does not: it has register map version 1. */
static void begin(void)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, BOARDS);
    memset(receivers, 0, sizeof receivers);
    for (size_t i = 0; i < BOARDS; i++) {
        sensors[i].count_of = count_of;
        if (i != BOARDS - 1u) {
            sensors[i].config.compact = (struct taxel_compact_memory){
                .states = states[i],
                .residuals = residuals[i],
                .buffers = {buffers[i][0], buffers[i][1]},
            };
        }
        boot_board(i);
    }
    fake.script = run_boards;
    is_host_silent = false;
    CHECK(fake_hub_start(&fake));
}

/* Check that counters balance and no frame is missing, and release the boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    fake_hub_free_boards(&fake);
}

/* Send the command START with these flags. Returns the status of the reply. */
static int start(uint8_t flags)
{
    return fake_hub_command(&fake, TAXEL_COMMAND_START, &flags, 1);
}

/* Send an ACKNOWLEDGE frame with one entry: the board address (with flags) and the id of its key frame. */
static void acknowledge(uint8_t address, uint16_t key_frame_id)
{
    uint8_t bytes[TAXEL_ACKNOWLEDGEMENT_SIZE] = {address};
    taxel_put_u16(bytes + 1, key_frame_id);
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_ACKNOWLEDGE, bytes, sizeof bytes);
}

/* Send the answer that the host's decoder has prepared for a board, unless the host is silent. */
static void answer(size_t board)
{
    struct taxel_compact_receiver *receiver = &receivers[board];
    if (receiver->answer && !is_host_silent) {
        const bool forget = receiver->answer == TAXEL_COMPACT_ANSWER_FORGET;
        acknowledge((uint8_t)(FIRST + board) | (forget ? TAXEL_ACKNOWLEDGE_FORGET : 0u), receiver->pending.id);
    }
    receiver->answer = TAXEL_COMPACT_ANSWER_NONE;
}

/* Decode a COMPACT_TAXELS frame as the host, and compare the counts with those of the board. */
static void receive(const struct fake_frame *frame)
{
    const size_t board = frame->payload[0] - FIRST;
    const uint8_t *bytes = frame->payload + TAXEL_TAXEL_HEADER_SIZE;
    struct taxel_compact_snapshot snapshot;
    const enum taxel_compact_result result = taxel_compact_receive(&receivers[board], frame->payload[0], TAXELS, bytes,
                                                                   frame->length - TAXEL_TAXEL_HEADER_SIZE, &snapshot);
    CHECK(result != TAXEL_COMPACT_DAMAGED);
    without_key_frame += result == TAXEL_COMPACT_NO_KEY_FRAME;
    if (result == TAXEL_COMPACT_OK) {
        decoded++;
        packed_frames += (bytes[2] & TAXEL_COMPACT_WIDTH_MASK) != 0;
        delta_frames += (bytes[2] & TAXEL_COMPACT_WIDTH_MASK) == 0;
        for (uint16_t i = 0; i < TAXELS; i++) {
            CHECK_EQUAL(snapshot.counts[i], count_at_rest(snapshot.sequence, i));
        }
    }
    answer(board);
}

/* Run poll cycles. After each cycle, the host decodes the frames received and sends its answers. */
static void run_cycles_and_answer(unsigned cycles)
{
    decoded = packed_frames = delta_frames = without_key_frame = 0;
    while (cycles--) {
        CHECK(fake_hub_run_cycles(&fake, 1));
        for (size_t i = 0; i < fake.frame_count; i++) {
            if (fake.frames[i].type == TAXEL_FRAME_TYPE_COMPACT_TAXELS) {
                receive(&fake.frames[i]);
            }
        }
        fake_hub_forget_frames(&fake);
    }
}

static void compact_snapshots_carry_the_counts_of_their_scans(void)
{
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    run_cycles_and_answer(40);
    CHECK(decoded >= 2u * 37u);
    CHECK(delta_frames >= 2u * 33u);
    CHECK_EQUAL(without_key_frame, 0);
    CHECK(fake_hub_run_cycles(&fake, 1));
    const struct fake_frame *last = fake_hub_last(&fake, TAXEL_FRAME_TYPE_COMPACT_TAXELS);
    if (CHECK(last)) {
        CHECK(last->length < TAXEL_TAXEL_HEADER_SIZE + TAXEL_SNAPSHOT_OVERHEAD + 2u * TAXELS - 8u);
    }
    end();
}

static void a_board_without_compact_snapshots_is_polled_uncompressed(void)
{
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    fake_hub_forget_frames(&fake);
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_BETWEEN(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST + BOARDS - 1u), 9, 10);
    CHECK_EQUAL(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_COMPACT_TAXELS, FIRST + BOARDS - 1u), 0);
    CHECK_BETWEEN(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST), 0, 1); /* the poll that was in progress */
    end();
}

static void each_start_selects_the_snapshot_format(void)
{
    begin();
    fake_hub_forget_frames(&fake);
    CHECK(fake_hub_run_cycles(&fake, 5));
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_COMPACT_TAXELS), 0);
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    CHECK(fake_hub_run_cycles(&fake, 5));
    CHECK(fake_hub_count(&fake, TAXEL_FRAME_TYPE_COMPACT_TAXELS) > 4);
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_START, NULL, 0), 0);
    CHECK(fake_hub_run_cycles(&fake, 1));
    fake_hub_forget_frames(&fake);
    CHECK(fake_hub_run_cycles(&fake, 5));
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_COMPACT_TAXELS), 0);
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST) >= 4);
    CHECK_EQUAL(start(0x02), TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
    end();
}

static void a_host_of_version_1_gets_uncompressed_snapshots(void)
{
    const uint8_t handshake[TAXEL_HOST_HANDSHAKE_SIZE] = {9, 1, 1};
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_HOST_HANDSHAKE, handshake, sizeof handshake);
    CHECK(fake_hub_run_cycles(&fake, 1)); /* one poll may be in progress */
    fake_hub_forget_frames(&fake);
    CHECK(fake_hub_run_cycles(&fake, 5));
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_COMPACT_TAXELS), 0);
    CHECK(fake_hub_count_of(&fake, TAXEL_FRAME_TYPE_TAXELS, FIRST) >= 4);
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
    CHECK_EQUAL(start(0), TAXEL_REPLY_STATUS_BAD_ARGUMENTS);
    end();
}

static void without_acknowledgements_boards_send_packed_frames(void)
{
    begin();
    is_host_silent = true;
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    run_cycles_and_answer(20);
    CHECK(decoded > 30);
    CHECK_EQUAL(delta_frames, 0);
    end();
}

static void a_host_that_lost_its_key_frames_gets_new_ones(void)
{
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    run_cycles_and_answer(20);
    memset(receivers, 0, sizeof receivers);
    run_cycles_and_answer(20);
    CHECK_BETWEEN(without_key_frame, 2, 2 * 4);
    CHECK(delta_frames > 20);
    run_cycles_and_answer(10);
    CHECK_EQUAL(without_key_frame, 0);
    CHECK(delta_frames >= 18);
    end();
}

static void a_damaged_compact_snapshot_is_read_again(void)
{
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    run_cycles_and_answer(20);
    const struct taxel_hub_slot before = *fake_hub_slot(&fake, FIRST);
    for (unsigned i = 0; i < 10; i++) {
        fake.devices[0].corrupt = 1;
        run_cycles_and_answer(2);
        CHECK_EQUAL(without_key_frame, 0);
        CHECK_EQUAL(fake.devices[0].corrupt, 0);
    }
    const struct taxel_hub_slot after = *fake_hub_slot(&fake, FIRST);
    CHECK_BETWEEN(after.retries - before.retries, 8, 10); /* or the damage hit a reading of the clock */
    CHECK_EQUAL(after.crc_errors, 0);
    CHECK(after.forwarded - before.forwarded >= 18u);
    end();
}

static void repeated_snapshots_are_not_forwarded(void)
{
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    run_cycles_and_answer(10);
    const struct taxel_hub_slot before = *fake_hub_slot(&fake, FIRST);
    fake.devices[0].held_scans = 5;
    run_cycles_and_answer(10);
    const struct taxel_hub_slot after = *fake_hub_slot(&fake, FIRST);
    /* one scan may have been skipped by a reading of the clock */
    CHECK_BETWEEN(after.repeated - before.repeated, 4, 5);
    CHECK_BETWEEN(taxel_hub_polls(&after) - taxel_hub_polls(&before), 10, 11); /* the next poll may be in progress */
    end();
}

static void a_restarted_board_is_reported_and_polled_again(void)
{
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    fake.now_us += 5000000u;
    run_cycles_and_answer(20);
    boot_board(0);
    fake.devices[0].clock_offset_us = 0u - (uint32_t)fake.now_us;
    sensors[0].clock_us = 0;
    CHECK(fake_hub_run_cycles(&fake, 6));
    CHECK_EQUAL(fake_hub_count_faults(&fake, FIRST, TAXEL_BOARD_FAULT_RESTARTED), 1);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_INFO), 1);
    run_cycles_and_answer(20);
    CHECK(delta_frames >= 30);
    end();
}

/* Delta frames hold 24 bits of the board's clock. Run an hour of delta frames with a board clock that is one percent
 * slow. */
static void an_hour_of_delta_frames_is_not_a_restart(void)
{
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    run_cycles_and_answer(20);
    for (unsigned i = 0; i < 6u * 130u; i++) {
        fake.now_us += 10000000u;
        fake.devices[0].clock_offset_us -= 100000u;
        sensors[0].clock_us += 9900000u;
        run_cycles_and_answer(2);
    }
    fake_hub_forget_frames(&fake);
    acknowledge(FIRST | TAXEL_ACKNOWLEDGE_FORGET, 0); /* the next frame is packed and holds all bits of the clock */
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_BOARD_FAULT), 0);
    end();
}

static void acknowledgements_are_accepted_during_a_command(void)
{
    const uint8_t scan[2] = {50, TAXEL_COMMAND_SCAN_BUS}, time[2] = {51, TAXEL_COMMAND_GET_TIME};
    begin();
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    fake_hub_forget_frames(&fake);
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, scan, sizeof scan);
    CHECK(fake.hub.command.active);
    acknowledge(FIRST + 1, 0x1234);
    CHECK(fake.hub.command.active);
    CHECK(fake_hub_slot(&fake, FIRST + 1)->acknowledge_pending);
    CHECK_EQUAL(fake_hub_slot(&fake, FIRST + 1)->key_frame_id, 0x1234);
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, time, sizeof time);
    fake_hub_run(&fake, 100000);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_REPLY), 2);
    CHECK(!fake_hub_slot(&fake, FIRST + 1)->acknowledge_pending);
    end();
}

static void acknowledgements_for_boards_without_compact_polls_are_dropped(void)
{
    begin();
    acknowledge(FIRST, 1); /* compact snapshots were not requested by START */
    CHECK(!fake_hub_slot(&fake, FIRST)->acknowledge_pending);
    CHECK_EQUAL(start(TAXEL_START_FLAG_COMPACT), 0);
    const uint64_t transfers = fake.transfers;
    acknowledge(FIRST + BOARDS - 1u, 1);
    acknowledge(0x50, 1);
    CHECK(fake_hub_run_cycles(&fake, 2));
    CHECK(fake.transfers > transfers);
    CHECK_EQUAL(fake_status(&sensors[BOARDS - 1u]).rejected_writes, 0);
    end();
}

int main(void)
{
    RUN(compact_snapshots_carry_the_counts_of_their_scans);
    RUN(a_board_without_compact_snapshots_is_polled_uncompressed);
    RUN(each_start_selects_the_snapshot_format);
    RUN(a_host_of_version_1_gets_uncompressed_snapshots);
    RUN(without_acknowledgements_boards_send_packed_frames);
    RUN(a_host_that_lost_its_key_frames_gets_new_ones);
    RUN(a_damaged_compact_snapshot_is_read_again);
    RUN(repeated_snapshots_are_not_forwarded);
    RUN(a_restarted_board_is_reported_and_polled_again);
    RUN(an_hour_of_delta_frames_is_not_a_restart);
    RUN(acknowledgements_are_accepted_during_a_command);
    RUN(acknowledgements_for_boards_without_compact_polls_are_dropped);
    return check_summary();
}
