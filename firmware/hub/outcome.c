/* What a finished transfer means. Every poll ends in exactly one counter, so that nothing is ever lost without a reason. */
#include "codec/crc32.h"
#include "hub/internal.h"

#define RETRIES 1u
#define FAILURES_UNTIL_ABSENT 3u
#define BUS_DOWN_US 10000u
#define UART_STALL_US 100000u /* a UART that takes nothing for so long has no reader: go on, and drop */
#define CLOCK_SLACK_US 500000u /* age of a snapshot, twice and with room */
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
        hub->bus_down_until_us = taxel_hub_now(hub) + BUS_DOWN_US;
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

static bool retry(struct taxel_hub *hub, struct taxel_hub_slot *board)
{
    if (board->attempts >= RETRIES) {
        return false;
    }
    board->attempts = (board->attempts + 1u) & 3u;
    board->retries++;
    board->retry = true;
    hub->retry_wanted = true;
    board->pointer_is_snapshot = false;
    return true;
}

static bool snapshot_is_whole(const struct taxel_hub_slot *board, const uint8_t *bytes, size_t size)
{
    if (size < TAXEL_COMPACT_OVERHEAD_CODED) {
        return false; /* the shortest of either kind */
    }
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &board->address, 1), bytes, size - 4u);
    return crc == taxel_get_u32(bytes + size - 4u);
}

/* The board's clock went back, or has not gone on as the hub's has: it began anew. */
static bool board_was_restarted(const struct taxel_hub_slot *board, uint32_t started_us, uint32_t timestamp_us)
{
    const uint32_t elapsed = started_us - board->last_read_us;
    const uint32_t board_elapsed = timestamp_us - board->last_timestamp_us;
    const bool went_back = board_elapsed >= HALF_CLOCK_RANGE && elapsed < HALF_CLOCK_RANGE;
    const uint32_t ahead = board_elapsed - elapsed;
    const uint32_t difference = ahead < HALF_CLOCK_RANGE ? ahead : 0u - ahead;
    return board->has_clock && (went_back || difference > CLOCK_SLACK_US + (elapsed >> CLOCK_SLACK_SHIFT));
}

void taxel_hub_keep(struct taxel_hub *hub, uint8_t type, size_t size)
{
    struct taxel_unframed *unframed = &hub->unframed;
    unframed->size = (uint16_t)size;
    unframed->cycle = hub->job.cycle;
    unframed->started_us = hub->job.started_us;
    unframed->slot = hub->job.slot;
    unframed->buffer = hub->job.buffer;
    unframed->type = type;
}

void taxel_hub_keep_snapshot(struct taxel_hub *hub)
{
    const struct taxel_job *job = &hub->job;
    if (!job->is_compact) {
        taxel_hub_keep(hub, TAXEL_FRAME_TYPE_TAXELS, job->read_size);
        return;
    }
    const size_t size = taxel_compact_size(taxel_hub_bytes(hub, job->buffer)[-1]);
    taxel_hub_keep(hub, TAXEL_FRAME_TYPE_COMPACT_TAXELS, size < job->read_size ? size : job->read_size - 1u);
}

/* The board's clock of a snapshot. A coded one has 24 bits of it: the others follow from what the hub's clock says. */
static uint32_t timestamp_of(const struct taxel_hub_slot *board, const struct taxel_unframed *unframed, const uint8_t *bytes,
                             bool is_coded)
{
    if (unframed->type == TAXEL_FRAME_TYPE_TAXELS) {
        return taxel_get_u32(bytes + TAXEL_SNAPSHOT_HEADER_OFFSET_TIMESTAMP_US);
    }
    if (!is_coded) {
        return taxel_get_u32(bytes + TAXEL_COMPACT_PACKED_OFFSET_TIMESTAMP_US);
    }
    const uint32_t expected = board->last_timestamp_us + unframed->started_us - board->last_read_us;
    const uint32_t low = taxel_get_u32(bytes + TAXEL_COMPACT_CODED_OFFSET_TIMESTAMP_LOW) << 8; /* and a byte that is not its */
    return expected + (uint32_t)((int32_t)(low - (expected << 8)) >> 8);
}

static bool try_forward(struct taxel_hub *hub, const struct taxel_hub_slot *board)
{
    const struct taxel_unframed *unframed = &hub->unframed;
    uint8_t head[TAXEL_TAXEL_HEADER_SIZE];
    const struct taxel_taxel_header header = {
        .address = board->address,
        .taxel_count = board->taxel_count,
        .cycle = unframed->cycle,
        .hub_time_us = unframed->started_us,
    };
    taxel_taxel_header_pack(&header, head);
    return taxel_hub_try_send_buffer(hub, unframed->type, head,
                                     unframed->type == TAXEL_FRAME_TYPE_BOARD_INFO ? 0 : sizeof head, unframed->buffer,
                                     unframed->size);
}

/* Back-pressure: while the UART is slower than the bus, the bus waits, so that every board has its turn; but a UART that
 * takes nothing at all must not stop the hub. */
static bool must_wait(struct taxel_hub *hub)
{
    struct taxel_unframed *unframed = &hub->unframed;
    const uint16_t mark = (uint16_t)(hub->outbox.tail - hub->outbox.large_left);
    const uint32_t now = taxel_hub_now(hub);
    if (hub->uart_mark != mark) {
        hub->uart_is_stalled = false;
    }
    if (!unframed->waits || hub->uart_mark != mark) {
        unframed->waits_since_us = now;
        hub->uart_mark = mark;
    }
    unframed->waits = true;
    hub->uart_is_stalled = hub->uart_is_stalled || now - unframed->waits_since_us >= UART_STALL_US;
    taxel_hub_wake_in(hub, TAXEL_HUB_ROOM_POLL_US);
    return !hub->uart_is_stalled;
}

void taxel_hub_forward(struct taxel_hub *hub)
{
    struct taxel_unframed *unframed = &hub->unframed;
    struct taxel_hub_slot *board = taxel_hub_slot_at(hub, unframed->slot);
    const bool is_taxels = unframed->type != TAXEL_FRAME_TYPE_BOARD_INFO;
    if (try_forward(hub, board)) {
        board->forwarded += is_taxels;
        hub->uart_is_stalled = false;
    } else if (must_wait(hub)) {
        return;
    } else {
        board->dropped += is_taxels;
        hub->outbox.frames_dropped++;
    }
    unframed->waits = false;
    unframed->size = 0;
}

/* False if it is not to be forwarded. */
static bool snapshot_is_news(struct taxel_hub *hub, struct taxel_hub_slot *board)
{
    const struct taxel_unframed *unframed = &hub->unframed;
    const uint8_t *bytes = taxel_hub_bytes(hub, unframed->buffer);
    if (!snapshot_is_whole(board, bytes, unframed->size)) {
        if (!retry(hub, board)) {
            board->crc_errors++;
            taxel_hub_fail(hub, board, TAXEL_BOARD_FAULT_CRC);
        }
        return false;
    }
    const uint16_t sequence = taxel_get_u16(bytes); /* both kinds begin so */
    const bool is_coded = unframed->type == TAXEL_FRAME_TYPE_COMPACT_TAXELS &&
                          !(bytes[TAXEL_COMPACT_HEADER_OFFSET_FORM] & TAXEL_COMPACT_WIDTH_MASK);
    const uint32_t timestamp_us = timestamp_of(board, unframed, bytes, is_coded);
    succeed(hub, board);
    if (!is_coded && board_was_restarted(board, unframed->started_us, timestamp_us)) { /* one that was has no reference */
        board->last_fault = TAXEL_BOARD_FAULT_RESTARTED;
        board->state = TAXEL_BOARD_STATE_IDENTIFYING; /* another board, or other settings, may answer now */
        board->has_sequence = false;
        taxel_hub_send_fault(hub, board, TAXEL_BOARD_FAULT_RESTARTED);
    }
    board->has_clock = board->has_clock || !is_coded;
    if (board->has_sequence && sequence == board->last_sequence) {
        board->repeated++;
        return false;
    }
    board->has_sequence = true;
    board->last_sequence = sequence;
    board->last_timestamp_us = timestamp_us;
    board->last_read_us = unframed->started_us;
    return true;
}

void taxel_hub_take_snapshot(struct taxel_hub *hub)
{
    struct taxel_hub_slot *board = taxel_hub_slot_at(hub, hub->unframed.slot);
    if (hub->unframed.size == 0) { /* a compact snapshot of length 0 */
        succeed(hub, board);
        board->repeated++;
    } else if (snapshot_is_news(hub, board)) {
        taxel_hub_forward(hub);
    } else {
        hub->unframed.size = 0;
    }
}

/* A poll that brought no snapshot. */
static void finish_failed_poll(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    switch (result) {
    case TAXEL_I2C_NACK_ADDRESS:
    case TAXEL_I2C_NACK_DATA:
        if (!retry(hub, board)) {
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
    if (bus_fault != TAXEL_BOARD_FAULT_NONE || !retry(hub, board)) {
        board->bus_errors++;
        taxel_hub_fail(hub, board, fault_of(result, bus_fault));
    }
}

static void finish_slot_probe(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_OK) {
        board->state = TAXEL_BOARD_STATE_IDENTIFYING;
        board->polls--; /* the board is back: its poll follows in this very cycle */
        if (hub->cycle.position == board - taxel_hub_slot_at(hub, 0) + 1) {
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

static void finish_address_probe(struct taxel_hub *hub, int8_t result)
{
    const struct taxel_job *job = &hub->job;
    if (result == TAXEL_I2C_OK && hub->sweep.for_command) {
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

TAXEL_OWN_FRAME static void send_clock(struct taxel_hub *hub, const struct taxel_hub_slot *board)
{
    uint8_t bytes[TAXEL_TIME_SYNC_SIZE];
    /* The board latched its clock when it was addressed for reading: four bytes before the end of the transfer. */
    const uint32_t bytes_us = ((uint32_t)sizeof(uint32_t) * 9u * 1000000u) / taxel_hub_config_of(hub)->scl_hz;
    const struct taxel_time_sync sync = {
        .address = board->address,
        .board_time_us = taxel_get_u32(taxel_hub_bytes(hub, hub->job.buffer)),
        .hub_time_us = taxel_hub_clock(hub) - bytes_us,
    };
    taxel_time_sync_pack(&sync, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_TIME_SYNC, bytes, sizeof bytes, NULL, 0);
}

static void finish_clock(struct taxel_hub *hub, const struct taxel_hub_slot *board, int8_t result)
{
    if (result == TAXEL_I2C_OK) {
        send_clock(hub, board);
    } else if (result != TAXEL_I2C_NACK_ADDRESS && result != TAXEL_I2C_NACK_DATA) {
        (void)taxel_hub_free_bus(hub);
    }
}

/* One that was lost is not repeated: the host says it again. */
static void finish_acknowledge(struct taxel_hub *hub, struct taxel_hub_slot *board, int8_t result)
{
    board->pointer_is_snapshot = result == TAXEL_I2C_OK;
    if (result != TAXEL_I2C_OK && result != TAXEL_I2C_NACK_ADDRESS && result != TAXEL_I2C_NACK_DATA) {
        (void)taxel_hub_free_bus(hub);
    }
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

static void finish_pass_through(struct taxel_hub *hub, int8_t result)
{
    if (result == TAXEL_I2C_TIMEOUT || result == TAXEL_I2C_BUSY || result == TAXEL_I2C_BUS_ERROR) {
        (void)taxel_hub_free_bus(hub);
    }
    taxel_hub_reply(hub, reply_status_of(result), taxel_hub_bytes(hub, hub->job.buffer),
                    result == TAXEL_I2C_OK ? hub->job.read_size : 0);
}

void taxel_hub_finish_job(struct taxel_hub *hub, int8_t result)
{
    struct taxel_job *job = &hub->job;
    const uint8_t kind = job->kind;
    struct taxel_hub_slot *board = job->slot == TAXEL_NO_SLOT ? NULL : taxel_hub_slot_at(hub, job->slot);
    job->kind = TAXEL_JOB_NONE; /* what else it says is still needed */
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
        hub->settings_read_slot = job->slot; /* taken over or not: reading back tells */
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
