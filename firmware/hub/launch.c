/* Start of each kind of transfer: bytes to write, bytes to read, deadline. */
#include "codec/crc32.h"
#include "hub/internal.h"

#define TIMEOUT_BASE_US 5000u /* clock stretching by the slave, in addition to the nominal duration of a transfer */
#define CLOCKS_PER_BYTE 9u
#define ADDRESS_BYTES 3u /* both addresses and slack for start and stop */

#define slot_at taxel_hub_slot_at

/* Return the time limit of a transfer in microseconds: twice the bus time of `bytes` data bytes and the address bytes,
 * and a constant for clock stretching. */
static uint32_t timeout_us(const struct taxel_hub *hub, size_t bytes)
{
    const uint32_t scl_hz = taxel_hub_config_of(hub)->scl_hz;
    const uint32_t byte_us = (2u * CLOCKS_PER_BYTE * 1000000u + scl_hz - 1u) / scl_hz;
    return TIMEOUT_BASE_US + byte_us * (uint32_t)(ADDRESS_BYTES + bytes);
}

/* Return whether the hub polls compact snapshots from `board`: the host requested them and the board supports them. */
static bool polls_compact(const struct taxel_hub *hub, const struct taxel_hub_slot *board)
{
    return hub->use_compact && board->has_compact;
}

/* Start the I2C transfer of a job (`kind`: enum taxel_job_kind) into the buffer at hub->job.pool_offset and set its
 * time limit. The transfer first writes the bytes hub->job.write_bytes; the bytes of a pass-through and of scan
 * settings are in other buffers. Scan settings are read to the space behind the identity, because both form one
 * BOARD_INFO frame. A compact snapshot is read together with its length byte, which is stored in the byte before the
 * buffer. */
void taxel_hub_launch(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t address, size_t read_size)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    struct taxel_job *job = &hub->job;
    struct taxel_i2c_transfer transfer = {
        .address = address,
        .write_bytes = job->write_bytes,
        .write_size = job->write_size,
        .read_bytes = taxel_hub_bytes(hub, job->pool_offset),
        .read_size = read_size,
    };
    if (kind == TAXEL_JOB_PASS_THROUGH) {
        transfer.write_bytes = hub->inbox.payload + TAXEL_COMMAND_HEADER_SIZE + TAXEL_TRANSFER_ARGUMENTS_SIZE;
        transfer.write_size = hub->command.transfer_size;
    } else if (kind == TAXEL_JOB_WRITE_SETTINGS) {
        transfer.write_bytes = transfer.read_bytes;
    } else if (kind == TAXEL_JOB_READ_SETTINGS) {
        transfer.read_bytes += TAXEL_IDENTITY_SIZE;
    }
    job->is_compact = kind == TAXEL_JOB_POLL && job->is_compact;
    if (job->is_compact) {
        transfer.read_bytes--;
        transfer.length_prefixed = true;
    }
    hub->cycle.has_launched = true;
    job->kind = kind;
    job->slot = slot;
    job->address = address;
    job->cycle = hub->cycle.number;
    job->read_size = (uint16_t)read_size;
    hub->job_done = false;
    job->started_us = taxel_hub_now(hub);
    job->deadline_us = job->started_us + timeout_us(hub, transfer.write_size + read_size);
    hal->i2c_start(hal->context, &transfer);
}

/* Start a read of `size` bytes from register `pointer` of a board. A poll omits the write of the register pointer if
 * the board's pointer is already at its snapshot. */
void taxel_hub_launch_read(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t pointer, size_t size)
{
    struct taxel_hub_slot *board = slot_at(hub, slot);
    hub->job.write_size = 1;
    hub->job.write_bytes[0] = pointer;
    if (kind == TAXEL_JOB_POLL && board->pointer_is_snapshot) {
        hub->job.write_size = 0;
    }
    board->pointer_is_snapshot = kind == TAXEL_JOB_POLL;
    taxel_hub_launch(hub, kind, slot, board->address, size);
}

/* Start a probe, an I2C transfer of the address alone, as a job of this `kind` (enum taxel_job_kind). `slot`: the board
 * with this address, or TAXEL_NO_SLOT. */
void taxel_hub_launch_probe(struct taxel_hub *hub, uint8_t kind, uint8_t slot, uint8_t address)
{
    hub->job.write_size = 0;
    taxel_hub_launch(hub, kind, slot, address, 0);
}

/* Return the largest number of bytes that a poll of `board` can read, without the length byte of a compact snapshot. */
size_t taxel_hub_poll_size(const struct taxel_hub *hub, const struct taxel_hub_slot *board)
{
    return polls_compact(hub, board) ? taxel_hub_compact_max(board)
                                     : TAXEL_SNAPSHOT_OVERHEAD + 2u * (size_t)board->taxel_count;
}

/* Start the poll of a board: a read of its compact or its uncompressed snapshot. */
void taxel_hub_launch_poll(struct taxel_hub *hub, uint8_t slot)
{
    const struct taxel_hub_slot *board = slot_at(hub, slot);
    const bool is_compact = polls_compact(hub, board); /* its length byte is then read first, into the headroom */
    hub->job.is_compact = is_compact;
    taxel_hub_launch_read(hub, TAXEL_JOB_POLL, slot, is_compact ? TAXEL_REGISTER_COMPACT : TAXEL_REGISTER_SNAPSHOT,
                          taxel_hub_poll_size(hub, board) + is_compact);
}

/* Start the write of a pending acknowledgement (key-frame id, 2 bytes) or of a "forget" (one zero byte) to the board's
 * register COMPACT. Returns false if nothing is pending. */
bool taxel_hub_launch_acknowledge(struct taxel_hub *hub, uint8_t slot)
{
    struct taxel_hub_slot *board = slot_at(hub, slot);
    uint8_t *bytes = hub->job.write_bytes;
    if (!polls_compact(hub, board) || !(board->acknowledge_pending || board->forget_pending)) {
        return false;
    }
    bytes[0] = TAXEL_REGISTER_COMPACT;
    bytes[1] = 0;
    if (board->acknowledge_pending) {
        taxel_put_u16(bytes + 1, board->key_frame_id);
    }
    hub->job.write_size = board->acknowledge_pending ? 3u : 2u;
    board->acknowledge_pending = board->forget_pending = false;
    taxel_hub_launch(hub, TAXEL_JOB_ACKNOWLEDGE, slot, board->address, 0);
    return true;
}

/* Start the write of the board's scan settings with their CRC-32. The CRC covers the I2C address, the front end (kind
 * of converter) unless it is 0, and the settings, so that a board rejects settings for another board or converter. */
void taxel_hub_launch_write_settings(struct taxel_hub *hub, uint8_t slot)
{
    struct taxel_hub_slot *board = slot_at(hub, slot);
    uint8_t *bytes = taxel_hub_bytes(hub, hub->job.pool_offset);
    bytes[0] = TAXEL_REGISTER_SETTINGS;
    taxel_scan_settings_pack(&board->settings, bytes + 1);
    const uint8_t tag[2] = {board->address, board->front_end};
    const uint32_t crc = taxel_crc32(taxel_crc32(0, tag, tag[1] ? 2 : 1), bytes + 1, TAXEL_SCAN_SETTINGS_SIZE);
    taxel_put_u32(bytes + 1 + TAXEL_SETTINGS_REGISTER_OFFSET_CRC32, crc);
    hub->job.write_size = (uint8_t)(1u + TAXEL_SETTINGS_REGISTER_SIZE);
    board->pointer_is_snapshot = false;
    taxel_hub_launch(hub, TAXEL_JOB_WRITE_SETTINGS, slot, board->address, 0);
}
