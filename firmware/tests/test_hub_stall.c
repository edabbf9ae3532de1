/* A UART without a reader: the hub continues, and the frames sent afterwards are complete, numbered and counted. */
#include "check.h"
#include "fake_hub.h"

#define FIRST 0x20
#define BOARDS 4
#define STALL_US 250000u /* longer than the hub's stall timeout */

static struct fake_hub fake;
static struct fake_sensor sensors[BOARDS];

/* Start a hub that streams from this number of boards. */
static void begin(size_t boards)
{
    fake_hub_init(&fake);
    fake_hub_add_boards(&fake, sensors, FIRST, boards);
    CHECK(fake_hub_start(&fake));
}

/* Describe boards of 16, 32, 48 and 64 taxels and a transfer pool that a few of their frames fill. `more`: bytes that
 * the pool has beyond the smallest possible size. */
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

/* Check that sequence numbers have no gap, no byte is discarded and each poll is in one counter, and release the
 * boards. */
static void end(void)
{
    CHECK(fake_hub_accounts_balance(&fake));
    CHECK_EQUAL(fake.sequence_gaps, 0);
    CHECK_EQUAL(fake.deframer.discarded_bytes, 0);
    fake_hub_free_boards(&fake);
}

/* Let the host read again, and check that it receives all frames that the hub has counted as sent. */
static void resume_reading(void)
{
    fake.drain_bytes = FAKE_PULL;
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_GET_TIME, NULL, 0), 0);
    CHECK_EQUAL(fake.deframer.frames, fake.hub.outbox.frames_sent);
}

/* Let the host read this number of bytes and then stop. */
static void read_bytes(size_t bytes)
{
    for (; bytes; bytes--) {
        fake.drain_bytes = 1;
        fake_hub_run(&fake, 10);
    }
    fake.drain_bytes = 0;
}

/* Return the number of snapshots of all boards that were not sent. */
static uint32_t dropped_snapshots(void)
{
    uint32_t dropped = 0;
    for (uint8_t i = 0; i < fake.hub.slot_count; i++) {
        dropped += fake.slots[i].dropped;
    }
    return dropped;
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
    for (uint8_t i = 0; i < 4; i++) {
        const struct taxel_hub_slot *slot = fake_hub_slot(&fake, (uint8_t)(FIRST + i));
        CHECK(slot->dropped > 100);
        CHECK_EQUAL(slot->nacks + slot->timeouts + slot->crc_errors + slot->bus_errors, 0);
    }
    CHECK(fake.hub.outbox.frames_dropped >= dropped_snapshots());
    const size_t waiting = taxel_hub_uart_pending(&fake.hub);
    CHECK_BETWEEN(waiting, 1, FAKE_RING + FAKE_POOL / 2 - 127); /* space for the longest reply is left */
    fake.drain_bytes = FAKE_PULL;
    CHECK(fake_hub_run_cycles(&fake, 10));
    CHECK_EQUAL(fake.deframer.frames, fake.hub.outbox.frames_sent);
    CHECK(fake.hub.outbox.frames_sent > frames_before);
    end();
}

/* The hub sends its clock regularly. Without space, these frames are dropped; they belong to no board's counter. */
static void dropped_clock_frames_are_counted(void)
{
    begin(4);
    fake.drain_bytes = 0;
    CHECK(fake_hub_run_cycles(&fake, 200)); /* the ring is full */
    const uint32_t before = fake.hub.outbox.frames_dropped - dropped_snapshots();
    CHECK(fake_hub_run_cycles(&fake, 400));
    const uint32_t growth = fake.hub.outbox.frames_dropped - dropped_snapshots() - before;
    CHECK(growth > 0);
    resume_reading();
    end();
}

static void without_a_reader_commands_are_still_executed_and_answered(void)
{
    const uint8_t identify[5] = {33, TAXEL_COMMAND_I2C_TRANSFER, FIRST, 64, 0};
    begin(4);
    fake.drain_bytes = 0;
    CHECK(fake_hub_run_cycles(&fake, 100));
    fake_hub_send(&fake, TAXEL_FRAME_TYPE_COMMAND, identify, sizeof identify);
    CHECK(fake_hub_run_cycles(&fake, 20));
    fake_hub_forget_frames(&fake);
    CHECK(fake.hub.inbox.commands >= 2); /* START and this command were executed before the host read any byte */
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

/* Commands that arrive without space for their answer wait; none is lost. */
static void commands_wait_for_space(void)
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

/* Return the number of LOG frames that replace a dropped frame. */
static size_t count_placeholders(void)
{
    size_t count = 0;
    for (size_t i = 0; i < fake.frame_count; i++) {
        count += fake.frames[i].type == TAXEL_FRAME_TYPE_LOG &&
                 taxel_get_u16(fake.frames[i].payload + TAXEL_LOG_HEADER_OFFSET_CODE) == TAXEL_LOG_CODE_FRAME_DROPPED;
    }
    return count;
}

/* At each stall the placeholders of the previous stall are still queued; the partly sent frame continues at its next
 * byte. */
static void repeated_stalls_leave_every_frame_intact_and_no_number_missing(void)
{
    size_t placeholders = 0;
    for (size_t taken = 0; taken <= 400; taken += 7) {
        set_up_a_full_pool(taken % 5 * 16);
        CHECK(fake_hub_start(&fake));
        CHECK(fake_hub_run_cycles(&fake, 3));
        for (unsigned stall = 0; stall < 4; stall++) {
            const uint32_t before = fake.hub.outbox.frames_dropped;
            fake.drain_bytes = 0;
            fake_hub_run(&fake, STALL_US);
            CHECK(fake.hub.outbox.frames_dropped > before);
            read_bytes(taken);
        }
        resume_reading();
        placeholders += count_placeholders();
        end();
    }
    CHECK(placeholders > 50); /* not every stall has a second frame in the pool */
}

/* When the stall is detected, the pool may hold board information, which no counter of a board contains. */
static void a_stall_during_identification_counts_no_snapshot(void)
{
    for (size_t taken = 0; taken <= 300; taken += 3) {
        set_up_a_full_pool(0);
        fake_hub_boot(&fake);
        read_bytes(taken);
        fake_hub_run(&fake, STALL_US);
        for (uint8_t i = 0; i < fake.hub.slot_count; i++) {
            CHECK_EQUAL(fake.slots[i].forwarded + fake.slots[i].dropped, 0);
        }
        fake.drain_bytes = FAKE_PULL;
        fake_hub_run(&fake, 100000);
        CHECK(fake_hub_handshake(&fake));
        CHECK_EQUAL(fake_hub_command(&fake, TAXEL_COMMAND_START, NULL, 0), 0);
        resume_reading();
        end();
    }
}

static void answers_in_the_ring_survive_a_stall(void)
{
    for (size_t taken = 0; taken < 200; taken += 9) {
        set_up_a_full_pool(0);
        CHECK(fake_hub_start(&fake));
        CHECK(fake_hub_run_cycles(&fake, 3));
        read_bytes(taken);
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
    RUN(dropped_clock_frames_are_counted);
    RUN(without_a_reader_commands_are_still_executed_and_answered);
    RUN(commands_wait_for_space);
    RUN(repeated_stalls_leave_every_frame_intact_and_no_number_missing);
    RUN(a_stall_during_identification_counts_no_snapshot);
    RUN(answers_in_the_ring_survive_a_stall);
    return check_summary();
}
