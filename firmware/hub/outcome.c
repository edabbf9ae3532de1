/* What a finished transfer means. Every poll ends in exactly one counter, so that nothing is ever lost without a reason. */
#include "codec/crc32.h"
#include "hub/internal.h"

#define RETRIES 1u
#define FAILURES_UNTIL_ABSENT 3u
#define IDENTITY_ATTEMPTS 3u
#define BUS_DOWN_US 10000u
#define CLOCK_SLACK_US 500000 /* age of a snapshot, twice and with room */
#define HALF_CLOCK_RANGE 0x80000000u
#define CLOCK_SLACK_SHIFT 3   /* and an eighth of the time between: no oscillator is that far off */

static void fail(struct taxel_hub *hub, struct taxel_hub_slot *board, uint8_t fault)
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

/* Free the bus. Returns the fault that remains, or TAXEL_BOARD_FAULT_NONE. */
static uint8_t recover_bus(struct taxel_hub *hub)
{
    const uint8_t fault = taxel_hub_recover_bus(hub);
    if (fault != TAXEL_BOARD_FAULT_NONE) {
        hub->bus_down_until_us = taxel_hub_clock(hub) + BUS_DOWN_US;
    }
    if (fault != hub->bus_fault) {
        hub->bus_fault = fault;
        tell_bus_fault(hub, fault);
    }
    return fault;
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
            fail(hub, board, TAXEL_BOARD_FAULT_CRC);
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
            fail(hub, board, TAXEL_BOARD_FAULT_NACK);
        }
        return;
    case TAXEL_I2C_TIMEOUT:
        (void)recover_bus(hub);
        board->timeouts++;
        fail(hub, board, TAXEL_BOARD_FAULT_TIMEOUT);
        return;
    default:
        break;
    }
    const uint8_t bus_fault = recover_bus(hub);
    if (bus_fault != TAXEL_BOARD_FAULT_NONE || !retry(board)) {
        board->bus_errors++;
        fail(hub, board, fault_of(result, bus_fault));
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
        fail(hub, board, TAXEL_BOARD_FAULT_NACK);
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
        (void)recover_bus(hub);
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

/* Why these 58 bytes are not those of a board that this hub can poll; TAXEL_BOARD_FAULT_NONE if they are. */
static uint8_t identity_fault(const struct taxel_hub *hub, uint8_t address, const uint8_t *bytes,
                              const struct taxel_identity *identity)
{
    if (identity->who_am_i != TAXEL_WHO_AM_I) {
        return TAXEL_BOARD_FAULT_NOT_A_TAXEL_BOARD;
    }
    if (identity->crc32 != taxel_crc32(0, bytes, TAXEL_IDENTITY_OFFSET_CRC32) || identity->address != address) {
        return TAXEL_BOARD_FAULT_CRC; /* misread, or read from another board by a flipped address bit */
    }
    if (identity->map_version != TAXEL_REGISTER_MAP_VERSION) {
        return TAXEL_BOARD_FAULT_MAP_VERSION;
    }
    if (identity->taxel_count == 0 || identity->taxel_count > TAXEL_TAXELS_MAX ||
        TAXEL_SNAPSHOT_OVERHEAD + 2u * (size_t)identity->taxel_count > hub->config->transfer_buffer_size) {
        return TAXEL_BOARD_FAULT_TOO_LARGE;
    }
    return TAXEL_BOARD_FAULT_NONE;
}

/* The board answered, but not as itself: its turn in this cycle is over, and that is its poll's outcome. */
static void end_turn(struct taxel_hub *hub, struct taxel_hub_slot *board, uint32_t *counter, uint8_t fault, uint8_t state)
{
    fail(hub, board, fault);
    board->state = state;
    board->info_wanted = false;
    if (hub->streaming && hub->cycle.position == board - hub->config->slots) {
        board->polls++;
        (*counter)++;
        hub->cycle.position++;
    }
}

static void end_turn_after_transfer(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_NACK_ADDRESS || result == TAXEL_I2C_NACK_DATA) {
        end_turn(hub, board, &board->nacks, TAXEL_BOARD_FAULT_NACK, TAXEL_BOARD_STATE_ABSENT);
        return;
    }
    (void)recover_bus(hub);
    if (result == TAXEL_I2C_TIMEOUT) {
        end_turn(hub, board, &board->timeouts, TAXEL_BOARD_FAULT_TIMEOUT, TAXEL_BOARD_STATE_ABSENT);
    } else {
        end_turn(hub, board, &board->bus_errors, TAXEL_BOARD_FAULT_ARBITRATION, TAXEL_BOARD_STATE_ABSENT);
    }
}

static void finish_identify(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board, int8_t result)
{
    const uint8_t *bytes = hub->config->transfer_buffers[job->buffer];
    struct taxel_identity identity;
    if (result != TAXEL_I2C_OK) {
        end_turn_after_transfer(hub, board, result);
        return;
    }
    taxel_identity_unpack(&identity, bytes);
    const uint8_t fault = identity_fault(hub, board->address, bytes, &identity);
    if (fault == TAXEL_BOARD_FAULT_NONE) {
        board->taxel_count = (uint8_t)identity.taxel_count;
        board->attempts = 0;
        hub->settings_read_slot = job->slot;
        hub->settings_read_kind = TAXEL_JOB_READ_SETTINGS;
        return;
    }
    /* A flipped bit can look like a foreign board: only the third such answer in a row is believed. */
    board->last_read_us = (uint32_t)job->started_us;
    const bool believed = fault != TAXEL_BOARD_FAULT_CRC && ++board->attempts >= IDENTITY_ATTEMPTS;
    end_turn(hub, board, &board->crc_errors, fault, believed ? TAXEL_BOARD_STATE_INCOMPATIBLE : TAXEL_BOARD_STATE_ABSENT);
}

static bool settings_are_whole(const struct taxel_hub_slot *board, const uint8_t *bytes)
{
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &board->address, 1), bytes, TAXEL_SCAN_SETTINGS_SIZE);
    return crc == taxel_get_u32(bytes + TAXEL_SETTINGS_REGISTER_OFFSET_CRC32);
}

static bool settings_are_as_wanted(const struct taxel_hub_slot *board, const uint8_t *bytes)
{
    uint8_t wanted[TAXEL_SCAN_SETTINGS_SIZE];
    taxel_scan_settings_pack(&board->settings, wanted);
    return memcmp(bytes, wanted, sizeof wanted) == 0;
}

/* Settings were read back after they had been written. Refused ones are not kept for the board's next start. */
static void finish_check_settings(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board,
                                  int8_t result)
{
    const uint8_t *bytes = hub->config->transfer_buffers[job->buffer];
    const bool whole = result == TAXEL_I2C_OK && settings_are_whole(board, bytes);
    board->settings_dirty = false;
    board->settings_rejected = !whole || !settings_are_as_wanted(board, bytes);
    if (board->settings_rejected) {
        board->has_settings = board->has_settings && !whole;
        taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_SETTINGS_REJECTED);
    }
}

/* Settings were read after an identity. */
static void finish_read_settings(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board,
                                 int8_t result)
{
    const uint8_t *bytes = hub->config->transfer_buffers[job->buffer];
    if (result != TAXEL_I2C_OK) {
        end_turn_after_transfer(hub, board, result);
        return;
    }
    if (!settings_are_whole(board, bytes)) {
        end_turn(hub, board, &board->crc_errors, TAXEL_BOARD_FAULT_CRC, TAXEL_BOARD_STATE_ABSENT);
        return;
    }
    board->state = TAXEL_BOARD_STATE_STREAMING;
    board->info_wanted = false;
    board->settings_dirty = board->has_settings && !settings_are_as_wanted(board, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_BOARD_INFO, hub->config->transfer_buffers[job->buffer ^ 1u],
                         TAXEL_IDENTITY_SIZE, bytes, TAXEL_SCAN_SETTINGS_SIZE);
}

static void finish_clock(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board, int8_t result)
{
    uint8_t bytes[TAXEL_TIME_SYNC_SIZE];
    if (result != TAXEL_I2C_OK) {
        if (result != TAXEL_I2C_NACK_ADDRESS && result != TAXEL_I2C_NACK_DATA) {
            (void)recover_bus(hub);
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
        (void)recover_bus(hub);
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
        finish_identify(hub, job, board, result);
        break;
    case TAXEL_JOB_WRITE_SETTINGS:
        hub->settings_read_slot = job->slot; /* taken over or not: reading back tells */
        hub->settings_read_kind = TAXEL_JOB_CHECK_SETTINGS;
        break;
    case TAXEL_JOB_READ_SETTINGS:
        finish_read_settings(hub, job, board, result);
        break;
    case TAXEL_JOB_CHECK_SETTINGS:
        finish_check_settings(hub, job, board, result);
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
