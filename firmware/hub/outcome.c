/* Evaluation of a finished transfer. Every poll increments exactly one outcome counter, so every loss has a reason. */
#include "hub/internal.h"

#define RETRIES 1u
#define FAILURES_UNTIL_ABSENT 3u
#define BUS_DOWN_US 10000u

/* Record a failed poll (`fault`: enum taxel_board_fault). The first of consecutive failures is reported to the host;
 * after three the board is absent, except for CRC errors, which show that the board responds. */
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

/* Record a successful poll: the first one after failures is reported to the host as BOARD_FAULT with fault RECOVERED.
 */
void taxel_hub_succeed(struct taxel_hub *hub, struct taxel_hub_slot *board)
{
    if (board->consecutive_failures) {
        taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_RECOVERED);
        board->consecutive_failures = 0;
    }
}

/* Queue a LOG frame about a change of the bus: SCL or SDA held low, or (TAXEL_BOARD_FAULT_NONE) free again. */
static void report_bus_fault(struct taxel_hub *hub, uint8_t fault)
{
    uint8_t level = TAXEL_LOG_LEVEL_ERROR;
    uint16_t code = TAXEL_LOG_CODE_SDA_STUCK;
    const char *text = "I2C: SDA low";
    if (fault == TAXEL_BOARD_FAULT_NONE) {
        level = TAXEL_LOG_LEVEL_INFO;
        code = TAXEL_LOG_CODE_BUS_FREE;
        text = "I2C: free";
    } else if (fault == TAXEL_BOARD_FAULT_SCL_STUCK) {
        code = TAXEL_LOG_CODE_SCL_STUCK;
        text = "I2C: SCL low";
    }
    taxel_hub_log(hub, level, code, text); /* one call: a call for each text takes more flash */
}

/* Record the state of the bus lines, and report a change to the host. */
static void note_bus_fault(struct taxel_hub *hub, uint8_t fault)
{
    if (fault != hub->bus_fault) {
        hub->bus_fault = fault;
        report_bus_fault(hub, fault);
    }
}

/* Recover the I2C bus after a failed transfer. If a line stays low, no transfer starts for 10 ms. Returns the remaining
 * fault, or TAXEL_BOARD_FAULT_NONE. */
uint8_t taxel_hub_free_bus(struct taxel_hub *hub)
{
    const uint8_t fault = taxel_hub_recover_bus(hub);
    if (fault != TAXEL_BOARD_FAULT_NONE) {
        hub->bus_down_until_us = taxel_hub_now(hub) + BUS_DOWN_US;
    }
    note_bus_fault(hub, fault);
    return fault;
}

/* Clear the bus fault after a transfer that reached its stop condition, which proves that both lines can move. */
void taxel_hub_note_result(struct taxel_hub *hub, int8_t result)
{
    if (result == TAXEL_I2C_OK || result == TAXEL_I2C_NACK_ADDRESS || result == TAXEL_I2C_NACK_DATA) {
        note_bus_fault(hub, TAXEL_BOARD_FAULT_NONE); /* the line was released without a recovery */
    }
}

/* Return the fault to be reported for a failed poll (enum taxel_board_fault): the bus fault that remains after the
 * recovery, or a fault derived from the transfer's result. */
static uint8_t fault_of(int8_t result, uint8_t bus_fault)
{
    if (bus_fault != TAXEL_BOARD_FAULT_NONE) {
        return bus_fault;
    }
    return result == TAXEL_I2C_BUSY ? TAXEL_BOARD_FAULT_SDA_STUCK : TAXEL_BOARD_FAULT_ARBITRATION;
}

/* NOLINTBEGIN(clang-analyzer-core.NullDereference): the transfers that these functions evaluate always have a slot */

/* Schedule a second poll of the board in the same cycle. Returns false if the board has already had its second attempt.
 */
bool taxel_hub_retry(struct taxel_hub *hub, struct taxel_hub_slot *board)
{
    if (board->attempts >= RETRIES) {
        return false;
    }
    board->attempts = (board->attempts + 1u) & 3u; /* a bit field of 2 bits */
    board->retries++;
    board->retry_pending = true;
    hub->has_retry = true;
    board->pointer_is_snapshot = false;
    return true;
}

/* Evaluate a poll whose transfer failed with `result`. After a NACK or a bus error, a second attempt is scheduled
 * first. A timeout, a second failure, and a fault that the recovery of the bus cannot remove are counted by their kind.
 * The bus is recovered after every failure except a NACK. */
static void finish_failed_poll(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    switch (result) {
    case TAXEL_I2C_NACK_ADDRESS:
    case TAXEL_I2C_NACK_DATA:
        if (!taxel_hub_retry(hub, board)) {
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
    if (bus_fault != TAXEL_BOARD_FAULT_NONE || !taxel_hub_retry(hub, board)) {
        board->bus_errors++;
        taxel_hub_fail(hub, board, fault_of(result, bus_fault));
    }
}

/* Evaluate the probe that replaces the poll of an absent board. A board that acknowledges its address again is
 * identified and polled in the same cycle. */
static void finish_slot_probe(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_OK) {
        board->state = TAXEL_BOARD_STATE_IDENTIFYING;
        board->polls--; /* the board is back: its poll follows in the same cycle */
        if (hub->cycle.position == board - taxel_hub_slot_at(hub, 0) + 1) {
            hub->cycle.position--; /* otherwise a new cycle has started and will reach this board */
        }
        return;
    }
    if (result == TAXEL_I2C_NACK_ADDRESS) {
        board->nacks++;
        taxel_hub_fail(hub, board, TAXEL_BOARD_FAULT_NACK);
        return;
    }
    board->attempts = RETRIES; /* a failed probe is not repeated in this cycle */
    finish_failed_poll(hub, board, result);
}

/* Add a newly found board. Slots are sorted by I2C address, so the indices of later slots in use elsewhere move up by
 * 1. Does nothing if all slots are occupied. */
static void add_slot(struct taxel_hub *hub, uint8_t address)
{
    uint8_t position = hub->slot_count;
    if (hub->slot_count == taxel_hub_config_of(hub)->slot_capacity) {
        return;
    }
    struct taxel_hub_slot *board = taxel_hub_slot_at(hub, position);
    for (; position && board[-1].address > address; board--, position--) {
        board[0] = board[-1];
    }
    memset(board, 0, sizeof *board);
    board->address = address;
    board->state = TAXEL_BOARD_STATE_IDENTIFYING;
    hub->slot_count++;
    if (hub->unframed.slot >= position) {
        hub->unframed.slot++;
    }
    if (hub->report.next > position + 1u) {
        hub->report.next++;
    }
    if (hub->cycle.position > position) {
        hub->cycle.position++;
    }
}

/* Evaluate a probe of one I2C address: add a new board, or update the state of a known board. During a scan for the
 * command SCAN_BUS, each address that acknowledges sets its bit in a bitmap in the inbox's payload buffer. */
static void finish_address_probe(struct taxel_hub *hub, int8_t result)
{
    const struct taxel_job *job = &hub->job;
    if (result == TAXEL_I2C_OK && hub->bus_scan.for_command) {
        hub->inbox.payload[job->address >> 3] |= (uint8_t)(1u << (job->address & 7u));
    } else if (result != TAXEL_I2C_OK && result != TAXEL_I2C_NACK_ADDRESS) {
        (void)taxel_hub_free_bus(hub);
    }
    if (job->slot == TAXEL_NO_SLOT) {
        if (result == TAXEL_I2C_OK) {
            add_slot(hub, job->address);
        }
        return;
    }
    struct taxel_hub_slot *board = taxel_hub_slot_at(hub, job->slot);
    if (result != TAXEL_I2C_OK && !hub->streaming) {
        board->state = TAXEL_BOARD_STATE_ABSENT;
    } else if (result == TAXEL_I2C_OK && board->state == TAXEL_BOARD_STATE_ABSENT) {
        board->state = TAXEL_BOARD_STATE_IDENTIFYING;
    }
}

/* Queue a TIME_SYNC frame: the board's clock just read (microseconds, 32 bits) and the hub's clock at the same instant.
 */
TAXEL_OWN_FRAME static void send_clock(struct taxel_hub *hub, const struct taxel_hub_slot *board)
{
    uint8_t bytes[TAXEL_TIME_SYNC_SIZE];
    /* The board latches its clock when it is addressed for reading: four bytes before the end of the transfer. */
    const uint32_t bytes_us = ((uint32_t)sizeof(uint32_t) * 9u * 1000000u) / taxel_hub_config_of(hub)->scl_hz;
    const struct taxel_time_sync sync = {
        .address = board->address,
        .board_time_us = taxel_get_u32(taxel_hub_bytes(hub, hub->job.pool_offset)),
        .hub_time_us = taxel_hub_clock(hub) - bytes_us,
    };
    taxel_time_sync_pack(&sync, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_TIME_SYNC, bytes, sizeof bytes, NULL, 0);
}

/* Evaluate the clock reading of a board and send it to the host as TIME_SYNC. */
static void finish_clock(struct taxel_hub *hub, const struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_OK) {
        send_clock(hub, board);
    } else if (result != TAXEL_I2C_NACK_ADDRESS && result != TAXEL_I2C_NACK_DATA) {
        (void)taxel_hub_free_bus(hub);
    }
}

/* Evaluate the write of an acknowledgement to a board. A lost acknowledgement is not repeated here: the host sends it
 * again. */
static void finish_acknowledge(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    board->pointer_is_snapshot = result == TAXEL_I2C_OK;
    if (result != TAXEL_I2C_OK && result != TAXEL_I2C_NACK_ADDRESS && result != TAXEL_I2C_NACK_DATA) {
        (void)taxel_hub_free_bus(hub);
    }
}

/* NOLINTEND(clang-analyzer-core.NullDereference) */

/* Return the status of the reply to I2C_TRANSFER (enum taxel_reply_status) for a transfer result (enum
 * taxel_i2c_result). */
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

/* Evaluate the transfer of the command I2C_TRANSFER and reply with the bytes read. */
static void finish_pass_through(struct taxel_hub *hub, int8_t result)
{
    if (result == TAXEL_I2C_TIMEOUT || result == TAXEL_I2C_BUSY || result == TAXEL_I2C_BUS_ERROR) {
        (void)taxel_hub_free_bus(hub);
    }
    taxel_hub_reply(hub, reply_status_of(result), taxel_hub_bytes(hub, hub->job.pool_offset),
                    result == TAXEL_I2C_OK ? hub->job.read_size : 0);
}

/* Evaluate a finished transfer by the kind of its job; `result`: enum taxel_i2c_result. Successful polls are not
 * evaluated here but in snapshot.c. */
void taxel_hub_finish_job(struct taxel_hub *hub, int8_t result)
{
    struct taxel_job *job = &hub->job;
    const uint8_t kind = job->kind;
    struct taxel_hub_slot *board = job->slot == TAXEL_NO_SLOT ? NULL : taxel_hub_slot_at(hub, job->slot);
    job->kind = TAXEL_JOB_NONE; /* the other members are still needed */
    switch (kind) {
    case TAXEL_JOB_POLL:
        finish_failed_poll(hub, board, result);
        break;
    case TAXEL_JOB_PROBE_SLOT:
        finish_slot_probe(hub, board, result);
        break;
    case TAXEL_JOB_IDENTIFY:
        taxel_hub_finish_identify(hub, board, result);
        break;
    case TAXEL_JOB_WRITE_SETTINGS:
        hub->settings_read_slot = job->slot; /* reading back shows whether the board accepted them */
        hub->settings_read_kind = TAXEL_JOB_CHECK_SETTINGS;
        break;
    case TAXEL_JOB_READ_SETTINGS:
        taxel_hub_finish_read_settings(hub, board, result);
        break;
    case TAXEL_JOB_CHECK_SETTINGS:
        taxel_hub_finish_check_settings(hub, board, result);
        break;
    case TAXEL_JOB_ACKNOWLEDGE:
        finish_acknowledge(hub, board, result);
        break;
    case TAXEL_JOB_CLOCK:
        finish_clock(hub, board, result);
        break;
    case TAXEL_JOB_PROBE_ADDRESS:
        finish_address_probe(hub, result);
        break;
    case TAXEL_JOB_PASS_THROUGH:
        finish_pass_through(hub, result);
        break;
    default:
        break;
    }
}
