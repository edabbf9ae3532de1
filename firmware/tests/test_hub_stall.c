/* A UART that nobody reads: the hub goes on, and what comes out afterwards is whole, numbered and counted. */
#include "check.h"
#include "fake_hub.h"

#define FIRST 0x20
#define BOARDS 4
#define STALL_US 250000u /* longer than the hub waits before it believes in a stall */

static struct fake_hub fake;
static struct fake_sensor sensors[BOARDS];

static void begin(size_t boards)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, boards);
    CHECK(fake_hub_start(&fake));
}

/* Boards of 16, 32, 48 and 64 taxels, and a pool as small as these allow: a few of their frames fill it. */
static void set_up_a_full_pool(size_t more)
{
    fake_hub_init(&fake);
    for (uint8_t i = 0; i < BOARDS; i++) {
        fake_sensor_init(&sensors[i], (uint8_t)(FIRST + i), (uint8_t)(2 * (i + 1)), 8, 0);
        CHECK_EQUAL(fake_sensor_boot(&sensors[i]), 0);
        fake_scan(&sensors[i], 1);
        (void)fake_hub_add(&fake, (uint8_t)(FIRST + i), &sensors[i]);
    }
    fake.config.transfer_pool_size = 2 * TAXEL_HUB_BUFFER_SIZE(TAXEL_SNAPSHOT_SIZE(64)) + more;
}

/* Numbers without a gap, no byte discarded, every poll in one counter. */
static void end(void)
{
    CHECK(fake_hub_accounts_hold(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    CHECK_EQUAL(fake.deframer.discarded_bytes, 0);
    fake_hub_free_boards(&fake);
}

static void read_on(void)
{
    fake.drain_bytes = FAKE_PULL;
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    CHECK_EQUAL(fake.deframer.frames, fake.hub.outbox.frames_sent);
}

/* The host takes some bytes, and no more. */
static void take(size_t bytes)
{
    for (; bytes; bytes--) {
        fake.drain_bytes = 1;
        fake_hub_run(&fake, 10);
    }
    fake.drain_bytes = 0;
}

static void without_a_reader_whole_frames_are_dropped_and_counted(void)
{
    begin(4);
    CHECK(fake_hub_run_cycles(&fake, 3));
    fake_hub_run(&fake, 100);
    const uint16_t frames_before = (uint16_t)fake.hub.outbox.frames_sent;
    fake_hub_forget_frames(&fake);
    fake.drain_bytes = 0;
    CHECK(fake_hub_run_cycles(&fake, 200));
    CHECK_EQUAL(fake.frame_count, 0);
    uint32_t dropped = 0;
    for (uint8_t i = 0; i < 4; i++) {
        const struct taxel_hub_slot *slot = fake_hub_slot(&fake, (uint8_t)(FIRST + i));
        CHECK(slot->dropped > 100);
        CHECK_EQUAL(slot->nacks + slot->timeouts + slot->crc_errors + slot->bus_errors, 0);
        dropped += slot->dropped;
    }
    CHECK(fake.hub.outbox.frames_dropped >= dropped);
    const size_t waiting = taxel_hub_uart_pending(&fake.hub);
    CHECK_BETWEEN(waiting, 1, FAKE_RING + FAKE_POOL / 2 - 127); /* room for the longest reply is left */
    fake.drain_bytes = FAKE_PULL;
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake.deframer.frames, fake.hub.outbox.frames_sent);
    CHECK(fake.hub.outbox.frames_sent > frames_before);
    end();
}

static void without_a_reader_commands_are_still_obeyed_and_answered(void)
{
    const uint8_t identify[5] = {33, TAXEL_COMMAND_I2C_TRANSFER, FIRST, 64, 0};
    begin(4);
    fake.drain_bytes = 0;
    CHECK(fake_hub_run_cycles(&fake, 100));
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, identify, sizeof identify);
    CHECK(fake_hub_run_cycles(&fake, 20));
    fake_hub_forget_frames(&fake);
    CHECK(fake.hub.inbox.commands >= 2); /* START, and this one: obeyed before anything was read */
    fake.drain_bytes = FAKE_PULL;
    fake_hub_run(&fake, 1000);
    const struct fake_frame *reply = fake_hub_last(&fake, TAXEL_FRAME_TYPE_REPLY);
    if (CHECK(reply)) {
        CHECK_EQUAL(reply->payload[0], 33);
        CHECK_EQUAL(reply->payload[2], 0);
        CHECK_EQUAL(reply->length, 3 + 64);
    }
    end();
}

/* Commands that come while there is no room for another answer wait; none is lost. */
static void commands_wait_for_room(void)
{
    begin(4);
    fake.drain_bytes = 0;
    CHECK(fake_hub_run_cycles(&fake, 100));
    for (uint8_t i = 0; i < 12; i++) {
        const uint8_t command[2] = {i, TAXEL_COMMAND_GET_TIME};
        fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, command, sizeof command);
        fake_hub_run(&fake, 1000);
    }
    fake_hub_forget_frames(&fake);
    fake.drain_bytes = FAKE_PULL;
    fake_hub_run(&fake, 10000);
    CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_REPLY), 12);
    end();
}

/* How many LOG frames say that they stand for one that was dropped. */
static size_t stand_ins(void)
{
    size_t count = 0;
    for (size_t i = 0; i < fake.frame_count; i++) {
        count += fake.frames[i].type == TAXEL_FRAME_TYPE_LOG &&
                 taxel_get_u16(fake.frames[i].payload + TAXEL_LOG_HEADER_OFFSET_CODE) == TAXEL_LOG_CODE_FRAME_DROPPED;
    }
    return count;
}

/* Each stall finds the words that stand for the frames of the one before still queued; what was begun goes on where it was. */
static void stall_after_stall_leaves_every_frame_whole_and_no_number_missing(void)
{
    size_t stood_in = 0;
    for (size_t taken = 0; taken <= 400; taken += 7) {
        set_up_a_full_pool(taken % 5 * 16);
        CHECK(fake_hub_start(&fake));
        CHECK(fake_hub_run_cycles(&fake, 3));
        for (unsigned stall = 0; stall < 4; stall++) {
            const uint32_t before = fake.hub.outbox.frames_dropped;
            fake.drain_bytes = 0;
            fake_hub_run(&fake, STALL_US);
            CHECK(fake.hub.outbox.frames_dropped > before);
            take(taken);
        }
        read_on();
        stood_in += stand_ins();
        end();
    }
    CHECK(stood_in > 50); /* not every stall finds a second frame in the pool */
}

/* What stands in the pool when the stall is noticed may be board information, which no board's counters know. */
static void a_stall_while_boards_are_identified_counts_no_snapshot(void)
{
    for (size_t taken = 0; taken <= 300; taken += 3) {
        set_up_a_full_pool(0);
        fake_hub_boot(&fake);
        take(taken);
        fake_hub_run(&fake, STALL_US);
        for (uint8_t i = 0; i < fake.hub.slot_count; i++) {
            CHECK_EQUAL(fake.slots[i].forwarded + fake.slots[i].dropped, 0);
        }
        fake.drain_bytes = FAKE_PULL;
        fake_hub_run(&fake, 100000);
        CHECK(fake_hub_handshake(&fake));
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_START, NULL, 0), 0);
        read_on();
        end();
    }
}

static void answers_in_the_ring_outlive_a_stall(void)
{
    for (size_t taken = 0; taken < 200; taken += 9) {
        set_up_a_full_pool(0);
        CHECK(fake_hub_start(&fake));
        CHECK(fake_hub_run_cycles(&fake, 3));
        take(taken);
        for (uint8_t i = 0; i < 3; i++) {
            const uint8_t command[2] = {(uint8_t)(100 + i), TAXEL_COMMAND_GET_TIME};
            fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, command, sizeof command);
            fake_hub_run(&fake, STALL_US);
        }
        fake_hub_forget_frames(&fake);
        fake.drain_bytes = FAKE_PULL;
        fake_hub_run(&fake, 100000);
        CHECK_EQUAL(fake_hub_count(&fake, TAXEL_FRAME_TYPE_REPLY), 3);
        end();
    }
}

int main(void)
{
    RUN(without_a_reader_whole_frames_are_dropped_and_counted);
    RUN(without_a_reader_commands_are_still_obeyed_and_answered);
    RUN(commands_wait_for_room);
    RUN(stall_after_stall_leaves_every_frame_whole_and_no_number_missing);
    RUN(a_stall_while_boards_are_identified_counts_no_snapshot);
    RUN(answers_in_the_ring_outlive_a_stall);
    return check_summary();
}
