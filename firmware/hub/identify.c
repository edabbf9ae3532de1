/* Identity and scan settings of a board: evaluation of the transfers that read or write them. */
#include "codec/crc32.h"
#include "hub/internal.h"

#define IDENTITY_ATTEMPTS 3u

/* Return the fault (enum taxel_board_fault) because of which these 58 bytes are not the identity of a board that this
 * hub can poll; TAXEL_BOARD_FAULT_NONE if the hub can poll the board. */
static uint8_t identity_fault(const struct taxel_hub *hub, uint8_t address, const uint8_t *bytes)
{
    const uint16_t taxel_count = taxel_get_u16(bytes + TAXEL_IDENTITY_OFFSET_TAXEL_COUNT);
    const uint8_t map_version = bytes[TAXEL_IDENTITY_OFFSET_MAP_VERSION];
    if (bytes[TAXEL_IDENTITY_OFFSET_WHO_AM_I] != TAXEL_WHO_AM_I) {
        return TAXEL_BOARD_FAULT_NOT_A_TAXEL_BOARD;
    }
    if (taxel_get_u32(bytes + TAXEL_IDENTITY_OFFSET_CRC32) != taxel_crc32(0, bytes, TAXEL_IDENTITY_OFFSET_CRC32) ||
        bytes[TAXEL_IDENTITY_OFFSET_ADDRESS] != address) {
        return TAXEL_BOARD_FAULT_CRC; /* damaged, or read from another board after a flipped address bit */
    }
    if (map_version < TAXEL_REGISTER_MAP_VERSION_MIN || map_version > TAXEL_REGISTER_MAP_VERSION) {
        return TAXEL_BOARD_FAULT_MAP_VERSION;
    }
    if (taxel_count == 0 || taxel_count > TAXEL_TAXELS_MAX ||
        TAXEL_SNAPSHOT_OVERHEAD + 2u * (size_t)taxel_count > taxel_hub_read_max(hub)) {
        return TAXEL_BOARD_FAULT_TOO_LARGE;
    }
    return TAXEL_BOARD_FAULT_NONE;
}

/* End the turn of a board that cannot be polled in this poll cycle: record the fault, set the state (2 bits) of the
 * board and, while streaming, increment `counter` as the outcome of its poll and continue with the next board. */
static void end_turn(struct taxel_hub *hub, struct taxel_hub_slot *board, uint32_t *counter, uint8_t fault,
                     uint8_t state)
{
    taxel_hub_fail(hub, board, fault);
    board->state = state & 3u;
    board->info_requested = false;
    if (hub->streaming && hub->cycle.position == board - taxel_hub_slot_at(hub, 0)) {
        board->polls++;
        (*counter)++;
        hub->cycle.position++;
    }
}

/* End the board's turn after a failed transfer: count the failure by the kind of `result` and mark the board as absent.
 * The bus is freed first, unless the board merely failed to acknowledge. */
static void end_turn_after_transfer(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_NACK_ADDRESS || result == TAXEL_I2C_NACK_DATA) {
        end_turn(hub, board, &board->nacks, TAXEL_BOARD_FAULT_NACK, TAXEL_BOARD_STATE_ABSENT);
        return;
    }
    (void)taxel_hub_free_bus(hub);
    if (result == TAXEL_I2C_TIMEOUT) {
        end_turn(hub, board, &board->timeouts, TAXEL_BOARD_FAULT_TIMEOUT, TAXEL_BOARD_STATE_ABSENT);
    } else {
        end_turn(hub, board, &board->bus_errors, TAXEL_BOARD_FAULT_ARBITRATION, TAXEL_BOARD_STATE_ABSENT);
    }
}

/* Evaluate the read of a board's identity register. A valid identity is followed by a read of the scan settings; an
 * identity of another device makes the board INCOMPATIBLE after repeated reads. */
void taxel_hub_finish_identify(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    const uint8_t *bytes = taxel_hub_bytes(hub, hub->job.pool_offset);
    if (result != TAXEL_I2C_OK) {
        end_turn_after_transfer(hub, board, result);
        return;
    }
    const uint8_t fault = identity_fault(hub, board->address, bytes);
    if (fault == TAXEL_BOARD_FAULT_NONE) {
        board->taxel_count = bytes[TAXEL_IDENTITY_OFFSET_TAXEL_COUNT];
        board->attempts = 0;
        board->acknowledge_pending = board->forget_pending = false;
        board->has_compact = bytes[TAXEL_IDENTITY_OFFSET_MAP_VERSION] > TAXEL_REGISTER_MAP_VERSION_MIN &&
                             board->taxel_count <= TAXEL_COMPACT_TAXELS_MAX &&
                             taxel_hub_compact_max(board) <= taxel_hub_read_max(hub);
        hub->settings_read_slot = hub->job.slot;
        hub->settings_read_kind = TAXEL_JOB_READ_SETTINGS;
        return;
    }
    /* A flipped bit can make a taxel board look like another device: the fault is accepted after three such reads in
     * a row. */
    board->last_read_us = hub->job.started_us;
    const bool is_accepted = fault != TAXEL_BOARD_FAULT_CRC && board->attempts + 1u >= IDENTITY_ATTEMPTS;
    if (fault != TAXEL_BOARD_FAULT_CRC && !is_accepted) {
        board->attempts = (board->attempts + 1u) & 3u;
    }
    end_turn(hub, board, &board->crc_errors, fault,
             is_accepted ? TAXEL_BOARD_STATE_INCOMPATIBLE : TAXEL_BOARD_STATE_ABSENT);
}

/* Return whether the 12 bytes read from the settings register of `board` have a correct CRC, which covers the board's
 * I2C address and the 8 bytes of settings. */
static bool settings_are_whole(const struct taxel_hub_slot *board, const uint8_t *bytes)
{
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &board->address, 1), bytes, TAXEL_SCAN_SETTINGS_SIZE);
    return crc == taxel_get_u32(bytes + TAXEL_SETTINGS_REGISTER_OFFSET_CRC32);
}

/* Return whether the 8 bytes of scan settings that were read from `board` equal the settings that the hub stored for
 * this board. */
static bool settings_match(const struct taxel_hub_slot *board, const uint8_t *bytes)
{
    uint8_t expected[TAXEL_SCAN_SETTINGS_SIZE];
    taxel_scan_settings_pack(&board->settings, expected);
    return memcmp(bytes, expected, sizeof expected) == 0;
}

/* Evaluate the scan settings that were read back from a board after a write. Settings that differ are reported as
 * rejected and are not written again after the board's next restart. After a failed read-back, the settings are also
 * reported as rejected, but they are written again after the next restart. */
void taxel_hub_finish_check_settings(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    const uint8_t *bytes = taxel_hub_bytes(hub, hub->job.pool_offset);
    const bool whole = result == TAXEL_I2C_OK && settings_are_whole(board, bytes);
    board->settings_dirty = false;
    board->settings_rejected = !whole || !settings_match(board, bytes);
    if (board->settings_rejected) {
        board->has_settings = board->has_settings && !whole;
        taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_SETTINGS_REJECTED);
    }
}

/* Evaluate the scan settings that were read from a board after its identity. They are stored directly behind the
 * identity, so that both form the payload of a BOARD_INFO frame. With valid settings the board is polled from then
 * on. */
void taxel_hub_finish_read_settings(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    const uint8_t *bytes = taxel_hub_bytes(hub, hub->job.pool_offset) + TAXEL_IDENTITY_SIZE;
    if (result != TAXEL_I2C_OK) {
        end_turn_after_transfer(hub, board, result);
        return;
    }
    if (!settings_are_whole(board, bytes)) {
        end_turn(hub, board, &board->crc_errors, TAXEL_BOARD_FAULT_CRC, TAXEL_BOARD_STATE_ABSENT);
        return;
    }
    board->state = TAXEL_BOARD_STATE_STREAMING;
    board->info_requested = false;
    board->settings_dirty = board->has_settings && !settings_match(board, bytes);
    taxel_hub_keep(hub, TAXEL_FRAME_TYPE_BOARD_INFO, TAXEL_IDENTITY_SIZE + TAXEL_SCAN_SETTINGS_SIZE);
    taxel_hub_forward(hub);
}
