/* What a finished transfer means. Every poll ends in exactly one counter, so that nothing is ever lost without a reason. */
#include "codec/crc32.h"
#include "hub/internal.h"

#define RETRIES 1u
#define FAILURES_UNTIL_ABSENT 3u
#define BUS_DOWN_US 10000u
#define CLOCK_SLACK_US 500000 /* age of a snapshot, twice and with room */
#define HALF_CLOCK_RANGE 0x80000000u
#define CLOCK_SLACK_SHIFT 3   /* and an eighth of the time between: no oscillator is that far off */

void taxel_hub_fail(struct taxel_hub *hub, struct taxel_hub_slot *board, uint8_t fault)
{
    board->last_fault = fault;
    board->pointer_is_snapshot = false;
    if (board->consecutive_failures < 0xFFFFu) {
        board->consecutive_failures++;
    }
    if (board->consecutive_failures == 1u) {
        taxel_hub_send_fault(hub, board, fault);
    }
    if (board->consecutive_failures >= FAILURES_UNTIL_ABSENT && fault != TAXEL_BOARD_FAULT_CRC) {
        board->state = TAXEL_BOARD_STATE_ABSENT;
    }
}

static void succeed(struct taxel_hub *hub, struct taxel_hub_slot *board)
{
    if (board->consecutive_failures) {
        taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_RECOVERED);
        board->consecutive_failures = 0;
    }
}

static void tell_bus_fault(struct taxel_hub *hub, uint8_t fault)
{
    if (fault == TAXEL_BOARD_FAULT_NONE) {
        taxel_hub_log(hub, TAXEL_LOG_LEVEL_INFO, TAXEL_LOG_CODE_BUS_FREE, "I2C bus: free again");
    } else if (fault == TAXEL_BOARD_FAULT_SCL_STUCK) {
        taxel_hub_log(hub, TAXEL_LOG_LEVEL_ERROR, TAXEL_LOG_CODE_SCL_STUCK, "I2C bus: SCL stays low");
    } else {
        taxel_hub_log(hub, TAXEL_LOG_LEVEL_ERROR, TAXEL_LOG_CODE_SDA_STUCK, "I2C bus: SDA stays low after nine clocks");
    }
}

static void note_bus_fault(struct taxel_hub *hub, uint8_t fault)
{
    if (fault != hub->bus_fault) {
        hub->bus_fault = fault;
        tell_bus_fault(hub, fault);
    }
}

/* Free the bus. Returns the fault that remains, or TAXEL_BOARD_FAULT_NONE. */
uint8_t taxel_hub_free_bus(struct taxel_hub *hub)
{
    const uint8_t fault = taxel_hub_recover_bus(hub);
    if (fault != TAXEL_BOARD_FAULT_NONE) {
        hub->bus_down_until_us = taxel_hub_clock(hub) + BUS_DOWN_US;
    }
    note_bus_fault(hub, fault);
    return fault;
}

void taxel_hub_note_result(struct taxel_hub *hub, int8_t result)
{
    if (result == TAXEL_I2C_OK || result == TAXEL_I2C_NACK_ADDRESS || result == TAXEL_I2C_NACK_DATA) {
        note_bus_fault(hub, TAXEL_BOARD_FAULT_NONE); /* a line that was let go by itself: no recovery tells */
    }
}

static uint8_t fault_of(int8_t result, uint8_t bus_fault)
{
    if (bus_fault != TAXEL_BOARD_FAULT_NONE) {
        return bus_fault;
    }
    return result == TAXEL_I2C_BUSY ? TAXEL_BOARD_FAULT_SDA_STUCK : TAXEL_BOARD_FAULT_ARBITRATION;
}

static bool retry(struct taxel_hub_slot *board)
{
    if (board->attempts >= RETRIES) {
        return false;
    }
    board->attempts++;
    board->retries++;
    board->retry = true;
    board->pointer_is_snapshot = false;
    return true;
}

static bool snapshot_is_whole(const struct taxel_hub_slot *board, const uint8_t *bytes, size_t size)
{
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &board->address, 1), bytes, size - 4u);
    return crc == taxel_get_u32(bytes + size - 4u);
}

/* The board's clock went back, or has not gone on as the hub's has: it began anew. */
static bool board_was_restarted(const struct taxel_hub_slot *board, const struct taxel_job *job,
                                const struct taxel_snapshot_header *snapshot)
{
    const uint32_t elapsed = (uint32_t)job->started_us - board->last_read_us;
    const uint32_t board_elapsed = snapshot->timestamp_us - board->last_timestamp_us;
    const bool went_back = board_elapsed >= HALF_CLOCK_RANGE && elapsed < HALF_CLOCK_RANGE;
    const int64_t difference = (int32_t)(board_elapsed - elapsed);
    const int64_t slack = CLOCK_SLACK_US + (int64_t)(elapsed >> CLOCK_SLACK_SHIFT);
    return board->has_sequence && (went_back || difference > slack || difference < -slack);
}

static void forward(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board)
{
    uint8_t head[TAXEL_TAXEL_HEADER_SIZE];
    const struct taxel_taxel_header header = {
        .address = board->address,
        .taxel_count = board->taxel_count,
        .cycle = job->cycle,
        .hub_time_us = (uint32_t)job->started_us,
    };
    taxel_taxel_header_pack(&header, head);
    if (taxel_hub_send(hub, TAXEL_FRAME_TYPE_TAXELS, head, sizeof head, hub->config->transfer_buffers[job->buffer],
                       job->read_size)) {
        board->forwarded++;
    } else {
        board->dropped++;
    }
}

void taxel_hub_take_snapshot(struct taxel_hub *hub, const struct taxel_job *job)
{
    struct taxel_hub_slot *board = &hub->config->slots[job->slot];
    const uint8_t *bytes = hub->config->transfer_buffers[job->buffer];
    struct taxel_snapshot_header snapshot;
    if (!snapshot_is_whole(board, bytes, job->read_size)) {
        if (!retry(board)) {
            board->crc_errors++;
            taxel_hub_fail(hub, board, TAXEL_BOARD_FAULT_CRC);
        }
        return;
    }
    succeed(hub, board);
    taxel_snapshot_header_unpack(&snapshot, bytes);
    if (board_was_restarted(board, job, &snapshot)) {
        board->last_fault = TAXEL_BOARD_FAULT_RESTARTED;
        board->state = TAXEL_BOARD_STATE_IDENTIFYING; /* another board, or other settings, may answer now */
        board->has_sequence = false;
        taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_RESTARTED);
    }
    if (board->has_sequence && snapshot.sequence == board->last_sequence) {
        board->repeated++;
        return;
    }
    board->has_sequence = true;
    board->last_sequence = snapshot.sequence;
    board->last_timestamp_us = snapshot.timestamp_us;
    board->last_read_us = (uint32_t)job->started_us;
    forward(hub, job, board);
}

/* A poll that brought no snapshot. */
static void finish_failed_poll(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    switch (result) {
    case TAXEL_I2C_NACK_ADDRESS:
    case TAXEL_I2C_NACK_DATA:
        if (!retry(board)) {
            board->nacks++;
            taxel_hub_fail(hub, board, TAXEL_BOARD_FAULT_NACK);
        }
        return;
    case TAXEL_I2C_TIMEOUT:
        (void)taxel_hub_free_bus(hub);
        board->timeouts++;
        taxel_hub_fail(hub, board, TAXEL_BOARD_FAULT_TIMEOUT);
        return;
    default:
        break;
    }
    const uint8_t bus_fault = taxel_hub_free_bus(hub);
    if (bus_fault != TAXEL_BOARD_FAULT_NONE || !retry(board)) {
        board->bus_errors++;
        taxel_hub_fail(hub, board, fault_of(result, bus_fault));
    }
}

static void finish_slot_probe(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_OK) {
        board->state = TAXEL_BOARD_STATE_IDENTIFYING;
        board->polls--; /* the board is back: its poll follows in this very cycle */
        if (hub->cycle.position == board - hub->config->slots + 1) {
            hub->cycle.position--; /* otherwise a new cycle has begun meanwhile and comes to this board by itself */
        }
        return;
    }
    if (result == TAXEL_I2C_NACK_ADDRESS) {
        board->nacks++;
        taxel_hub_fail(hub, board, TAXEL_BOARD_FAULT_NACK);
        return;
    }
    board->attempts = RETRIES;
    finish_failed_poll(hub, board, result);
}

static void add_slot(struct taxel_hub *hub, uint8_t address)
{
    uint8_t position = hub->slot_count;
    if (hub->slot_count == hub->config->slot_capacity) {
        return;
    }
    while (position && hub->config->slots[position - 1u].address > address) {
        hub->config->slots[position] = hub->config->slots[position - 1u];
        position--;
    }
    struct taxel_hub_slot *board = &hub->config->slots[position];
    memset(board, 0, sizeof *board);
    board->address = address;
    board->state = TAXEL_BOARD_STATE_IDENTIFYING;
    hub->slot_count++;
    if (hub->report.next > position + 1u) {
        hub->report.next++;
    }
    if (hub->cycle.position > position) {
        hub->cycle.position++;
    }
}

static void finish_address_probe(struct taxel_hub *hub, const struct taxel_job *job, int8_t result)
{
    if (result == TAXEL_I2C_OK) {
        hub->sweep.found[job->address >> 3] |= (uint8_t)(1u << (job->address & 7u));
    } else if (result != TAXEL_I2C_NACK_ADDRESS) {
        (void)taxel_hub_free_bus(hub);
    }
    if (job->slot == TAXEL_NO_SLOT) {
        if (result == TAXEL_I2C_OK) {
            add_slot(hub, job->address);
        }
        return;
    }
    struct taxel_hub_slot *board = &hub->config->slots[job->slot];
    if (result != TAXEL_I2C_OK && !hub->streaming) {
        board->state = TAXEL_BOARD_STATE_ABSENT;
    } else if (result == TAXEL_I2C_OK && board->state == TAXEL_BOARD_STATE_ABSENT) {
        board->state = TAXEL_BOARD_STATE_IDENTIFYING;
    }
}

static void finish_clock(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board, int8_t result)
{
    uint8_t bytes[TAXEL_TIME_SYNC_SIZE];
    if (result != TAXEL_I2C_OK) {
        if (result != TAXEL_I2C_NACK_ADDRESS && result != TAXEL_I2C_NACK_DATA) {
            (void)taxel_hub_free_bus(hub);
        }
        return;
    }
    /* The board latched its clock when it was addressed for reading: four bytes before the end of the transfer. */
    const uint64_t bytes_us = (sizeof(uint32_t) * 9u * 1000000u) / hub->config->scl_hz;
    const struct taxel_time_sync sync = {
        .address = board->address,
        .board_time_us = taxel_get_u32(hub->config->transfer_buffers[job->buffer]),
        .hub_time_us = taxel_hub_clock(hub) - bytes_us,
    };
    taxel_time_sync_pack(&sync, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_TIME_SYNC, bytes, sizeof bytes, NULL, 0);
}

static uint8_t reply_status_of(int8_t result)
{
    switch (result) {
    case TAXEL_I2C_OK:
        return TAXEL_REPLY_STATUS_OK;
    case TAXEL_I2C_NACK_ADDRESS:
    case TAXEL_I2C_NACK_DATA:
        return TAXEL_REPLY_STATUS_NACK;
    case TAXEL_I2C_TIMEOUT:
        return TAXEL_REPLY_STATUS_TIMEOUT;
    default:
        return TAXEL_REPLY_STATUS_BUS_ERROR;
    }
}

static void finish_pass_through(struct taxel_hub *hub, const struct taxel_job *job, int8_t result)
{
    if (result == TAXEL_I2C_TIMEOUT || result == TAXEL_I2C_BUSY || result == TAXEL_I2C_BUS_ERROR) {
        (void)taxel_hub_free_bus(hub);
    }
    taxel_hub_reply(hub, reply_status_of(result), hub->config->transfer_buffers[job->buffer],
                    result == TAXEL_I2C_OK ? job->read_size : 0);
}

void taxel_hub_finish_job(struct taxel_hub *hub, const struct taxel_job *job, int8_t result)
{
    struct taxel_hub_slot *board = job->slot == TAXEL_NO_SLOT ? NULL : &hub->config->slots[job->slot];
    switch (job->kind) {
    case TAXEL_JOB_POLL:
        finish_failed_poll(hub, board, result);
        break;
    case TAXEL_JOB_PROBE_SLOT:
        finish_slot_probe(hub, board, result);
        break;
    case TAXEL_JOB_IDENTIFY:
        taxel_hub_finish_identify(hub, job, board, result);
        break;
    case TAXEL_JOB_WRITE_SETTINGS:
        hub->settings_read_slot = job->slot; /* taken over or not: reading back tells */
        hub->settings_read_kind = TAXEL_JOB_CHECK_SETTINGS;
        break;
    case TAXEL_JOB_READ_SETTINGS:
        taxel_hub_finish_read_settings(hub, job, board, result);
        break;
    case TAXEL_JOB_CHECK_SETTINGS:
        taxel_hub_finish_check_settings(hub, job, board, result);
        break;
    case TAXEL_JOB_CLOCK:
        finish_clock(hub, job, board, result);
        break;
    case TAXEL_JOB_PROBE_ADDRESS:
        finish_address_probe(hub, job, result);
        break;
    case TAXEL_JOB_PASS_THROUGH:
        finish_pass_through(hub, job, result);
        break;
    default:
        break;
    }
}
