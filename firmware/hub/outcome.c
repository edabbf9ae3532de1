/* What a finished transfer means. Every poll ends in exactly one counter, so that nothing is ever lost without a reason. */
#include "codec/crc32.h"
#include "hub/internal.h"

#define RETRIES 1u
#define FAILURES_UNTIL_ABSENT 3u
#define IDENTITY_ATTEMPTS 3u
#define BUS_DOWN_US 10000u
#define RESTART_GAP_US 60000000u /* a board clock that jumped by more than this has been restarted */

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

static void recover_bus(struct taxel_hub *hub, struct taxel_hub_slot *board)
{
    const uint8_t fault = taxel_hub_recover_bus(hub);
    if (fault != TAXEL_BOARD_FAULT_NONE) {
        hub->bus_down_until_us = taxel_hub_clock(hub) + BUS_DOWN_US;
        if (board) {
            board->last_fault = fault;
        }
    }
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

static bool board_was_restarted(const struct taxel_hub_slot *board, const struct taxel_snapshot_header *snapshot)
{
    return board->has_sequence && snapshot->timestamp_us - board->last_timestamp_us > RESTART_GAP_US;
}

static void forward(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board)
{
    uint8_t head[TAXEL_TAXEL_HEADER_SIZE];
    const struct taxel_taxel_header header = {
        .address = board->address,
        .taxel_count = board->taxel_count,
        .cycle = hub->cycle.number,
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
    if (board_was_restarted(board, &snapshot)) {
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
        recover_bus(hub, NULL);
        board->timeouts++;
        fail(hub, board, TAXEL_BOARD_FAULT_TIMEOUT);
        return;
    default:
        recover_bus(hub, board);
        if (hub->bus_down_until_us > taxel_hub_clock(hub) || !retry(board)) {
            board->bus_errors++;
            fail(hub, board, result == TAXEL_I2C_BUSY ? TAXEL_BOARD_FAULT_SDA_STUCK : TAXEL_BOARD_FAULT_ARBITRATION);
        }
        return;
    }
}

static void finish_slot_probe(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_OK) {
        board->state = TAXEL_BOARD_STATE_IDENTIFYING;
        board->polls--; /* the board is back: its poll follows in this very cycle */
        hub->cycle.position--;
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
        recover_bus(hub, NULL);
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
static uint8_t identity_fault(const struct taxel_hub *hub, const uint8_t *bytes, const struct taxel_identity *identity)
{
    if (identity->who_am_i != TAXEL_WHO_AM_I) {
        return TAXEL_BOARD_FAULT_NOT_A_TAXEL_BOARD;
    }
    if (identity->crc32 != taxel_crc32(0, bytes, TAXEL_IDENTITY_OFFSET_CRC32)) {
        return TAXEL_BOARD_FAULT_CRC;
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
    if (hub->streaming) {
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
    recover_bus(hub, NULL);
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
    const uint8_t fault = identity_fault(hub, bytes, &identity);
    if (fault == TAXEL_BOARD_FAULT_NONE) {
        board->taxel_count = (uint8_t)identity.taxel_count;
        board->attempts = 0;
        hub->settings_read_slot = job->slot;
        return;
    }
    /* A flipped bit can look like a foreign board: only the third such answer in a row is believed. */
    const bool believed = fault != TAXEL_BOARD_FAULT_CRC && ++board->attempts >= IDENTITY_ATTEMPTS;
    end_turn(hub, board, &board->crc_errors, fault, believed ? TAXEL_BOARD_STATE_INCOMPATIBLE : TAXEL_BOARD_STATE_ABSENT);
}

static bool settings_are_whole(const struct taxel_hub_slot *board, const uint8_t *bytes)
{
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &board->address, 1), bytes, TAXEL_SCAN_SETTINGS_SIZE);
    return crc == taxel_get_u32(bytes + TAXEL_SETTINGS_REGISTER_OFFSET_CRC32);
}

/* Settings were read, after an identity or after a write of settings: the other transfer buffer tells which. */
static void finish_read_settings(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board,
                                 int8_t result)
{
    const uint8_t *bytes = hub->config->transfer_buffers[job->buffer];
    uint8_t wanted[TAXEL_SCAN_SETTINGS_SIZE];
    const bool whole = result == TAXEL_I2C_OK && settings_are_whole(board, bytes);
    taxel_scan_settings_pack(&board->settings, wanted);
    const bool as_wanted = whole && memcmp(bytes, wanted, sizeof wanted) == 0;
    if (board->state == TAXEL_BOARD_STATE_STREAMING && board->settings_dirty && !board->info_wanted) {
        board->settings_dirty = false;
        board->settings_rejected = !as_wanted;
        if (!as_wanted) {
            taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_SETTINGS_REJECTED);
        }
        return;
    }
    if (result != TAXEL_I2C_OK) {
        end_turn_after_transfer(hub, board, result);
        return;
    }
    if (!whole) {
        end_turn(hub, board, &board->crc_errors, TAXEL_BOARD_FAULT_CRC, TAXEL_BOARD_STATE_ABSENT);
        return;
    }
    board->state = TAXEL_BOARD_STATE_STREAMING;
    board->info_wanted = false;
    board->settings_dirty = board->has_settings && !as_wanted;
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_BOARD_INFO, hub->config->transfer_buffers[job->buffer ^ 1u],
                         TAXEL_IDENTITY_SIZE, bytes, TAXEL_SCAN_SETTINGS_SIZE);
}

static void finish_clock(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board, int8_t result)
{
    uint8_t bytes[TAXEL_TIME_SYNC_SIZE];
    if (result != TAXEL_I2C_OK) {
        if (result != TAXEL_I2C_NACK_ADDRESS && result != TAXEL_I2C_NACK_DATA) {
            recover_bus(hub, NULL);
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
        recover_bus(hub, NULL);
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
        break;
    case TAXEL_JOB_READ_SETTINGS:
        finish_read_settings(hub, job, board, result);
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
