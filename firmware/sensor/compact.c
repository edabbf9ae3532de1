/* Compact snapshots on the board: selection and acknowledgement of key frames, encoding, and the two buffers. The main
 * loop encodes into work_buffer and exchanges it with reader_buffer when no read is in progress, so that neither side
 * waits for the other. A key frame is a snapshot that host and board use as the reference of later delta frames. */
#include "codec/crc32.h"
#include "sensor/sensor.h"

#define IDLE_US 10000000u /* after this time without a read, encoding stops */
/* snapshots between key frames without touches: an acknowledgement costs 4 bytes on the bus */
#define PERIOD 16u
#define TIMEOUT_READS_FIRST 8u
#define TIMEOUT_READS_MAX 32u
#define ELAPSED_MAX 0xFFFFFFu /* us since the key frame: a delta frame has only three bytes of the timestamp */
#define CRC_SIZE 4u

/* Mask all interrupts of the board. Returns the state that unmask() restores. */
static uint32_t mask(const struct taxel_sensor *sensor)
{
    return sensor->config->hal->interrupts_disable(sensor->config->hal->context);
}

/* Restore the interrupt state that mask() returned. */
static void unmask(const struct taxel_sensor *sensor, uint32_t interrupts)
{
    sensor->config->hal->interrupts_restore(sensor->config->hal->context, interrupts);
}

/* Return the clock of the board in microseconds, modulo 2^32. */
static uint32_t clock_us(const struct taxel_sensor *sensor)
{
    return sensor->config->hal->clock_us(sensor->config->hal->context);
}

/* Return whether the board offers compact snapshots: it has memory for them and at most TAXEL_COMPACT_TAXELS_MAX
 * taxels. */
bool taxel_sensor_has_compact(const struct taxel_sensor *sensor)
{
    return sensor->config->compact.states && sensor->config->taxel_count <= TAXEL_COMPACT_TAXELS_MAX;
}

/* Initialise the encoding of compact snapshots: no snapshot is ready and no key frame exists. */
void taxel_sensor_compact_init(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    compact->reader_buffer = sensor->config->compact.buffers[0];
    compact->work_buffer = sensor->config->compact.buffers[1];
    compact->pending.timeout_reads = TIMEOUT_READS_FIRST;
}

/* Begin a read of register COMPACT (I2C interrupt). The reader gets length byte and newest compact snapshot, or a
 * single 0 if it has read this snapshot already; `again`: a snapshot that was read already may be read once more. */
void taxel_sensor_compact_begin_read(struct taxel_sensor *sensor, bool again)
{
    static const uint8_t nothing_new;
    struct taxel_compact *compact = &sensor->compact;
    struct taxel_slave *slave = &sensor->slave;
    compact->last_read_us = clock_us(sensor);
    compact->has_reader = true;
    slave->source_position = 0;
    if (!compact->is_unread && !(again && compact->reader_buffer_valid)) {
        slave->source = &nothing_new;
        slave->source_size = 1;
        return;
    }
    if (compact->is_unread) {
        compact->is_unread = false;
        compact->reads_since_key_frame =
            (uint8_t)(compact->reads_since_key_frame + (compact->reads_since_key_frame < UINT8_MAX));
        slave->snapshot_reads++;
    }
    compact->read_in_progress = true;
    slave->source = compact->reader_buffer;
    slave->source_size = 1u + (size_t)taxel_compact_size(compact->reader_buffer[0]);
}

/* End a read of the compact snapshot: its buffer may be replaced by a newer snapshot. */
void taxel_sensor_compact_end_read(struct taxel_sensor *sensor)
{
    sensor->compact.read_in_progress = false;
}

/* Store a complete write to register COMPACT for the main loop (I2C interrupt). Two bytes acknowledge a key frame by
 * its id; one zero byte requests a new key frame. Returns false for any other bytes, which are ignored. */
bool taxel_sensor_compact_write(struct taxel_sensor *sensor, const uint8_t *bytes, size_t size)
{
    struct taxel_compact *compact = &sensor->compact;
    if (size == TAXEL_COMPACT_ACKNOWLEDGE_SIZE) {
        compact->acknowledged_id = taxel_get_u16(bytes);
        compact->acknowledge_received = true;
        return true;
    }
    compact->forget_received = compact->forget_received || (size == 1 && bytes[0] == 0);
    return size == 1 && bytes[0] == 0;
}

/* Make the pending key frame, which the host has acknowledged, the current one. After a packed key frame
 * `states` are already set; otherwise each state is updated with the residual (difference from the prediction)
 * of its taxel. */
static void accept_key_frame(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    const struct taxel_compact_memory *memory = &sensor->config->compact;
    for (size_t i = 0; i < sensor->config->taxel_count && !compact->pending.is_packed; i++) {
        memory->states[i] = taxel_compact_update(memory->states[i], memory->residuals[i], compact->updates);
    }
    if (compact->pending.is_packed) {
        compact->updates = 1;
        compact->usual_size = UINT16_MAX; /* unknown: the first encoded delta frame sets it */
    } else if (compact->updates < TAXEL_COMPACT_UPDATES_MAX) {
        compact->updates++;
    }
    compact->pending.is_pending = false;
    compact->has_key_frame = true;
    compact->key_frame_id = compact->pending.id;
    compact->key_frame_us = compact->pending.timestamp_us;
}

/* Apply the acknowledgement and the request for a new key frame that the host wrote since the last call. In this way
 * the states of the taxels change only between two snapshots, never while the encoder uses them. */
static void process_answers(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t interrupts = mask(sensor);
    const bool acknowledged = compact->acknowledge_received, forget = compact->forget_received;
    const uint16_t id = compact->acknowledged_id;
    compact->acknowledge_received = compact->forget_received = false;
    compact->is_unread = compact->is_unread && !forget; /* the host could not decode the snapshot */
    unmask(sensor, interrupts);
    if (acknowledged && compact->pending.is_pending && compact->pending.id == id) {
        accept_key_frame(sensor);
    }
    if (forget) {
        compact->has_key_frame = compact->pending.is_pending = compact->work_ready = false;
        compact->pending.timeout_reads = TIMEOUT_READS_FIRST;
    }
}

/* Return whether the encoder may latch the newest scan: compact snapshots are being read, and there is a new scan. A
 * reader of an uncompressed snapshot in blocks keeps its snapshot: nothing is latched while the register pointer is at
 * these blocks. */
static bool may_latch(const struct taxel_sensor *sensor)
{
    const uint8_t pointer = sensor->slave.pointer;
    return sensor->compact.has_reader && sensor->scan.has_newest &&
           (pointer < TAXEL_REGISTER_SNAPSHOT || pointer > TAXEL_REGISTER_SNAPSHOT_LAST);
}

/* Latch the newest complete scan for encoding; returns false if no scan may be latched (may_latch()). After a latch,
 * *latches is the number of latches so far: if the number is another one later, a reader has latched another scan. If
 * no compact snapshot has been read for IDLE_US, the board no longer has a reader of compact snapshots. */
static bool latch_newest(struct taxel_sensor *sensor, uint8_t *latches)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t interrupts = mask(sensor);
    if (compact->has_reader && clock_us(sensor) - compact->last_read_us > IDLE_US) {
        compact->has_reader = compact->is_unread = compact->reader_buffer_valid = false;
    }
    const bool is_latched = may_latch(sensor);
    if (is_latched) {
        taxel_scan_latch(sensor);
        *latches = sensor->scan.latches;
    }
    unmask(sensor, interrupts);
    return is_latched;
}

/* Return whether the next compact snapshot must be marked as a key frame. A key frame is pending until the host
 * acknowledges it.
 * - No key frame is pending: true if no key frame is acknowledged, if the predictions still adapt to the counts, if the
 *   encoded size has grown, or if PERIOD snapshots were read since the last key frame.
 * - A key frame is pending: true if it was not read yet, or if its acknowledgement is overdue. An overdue
 *   acknowledgement doubles the timeout of the next one, up to TIMEOUT_READS_MAX. */
static bool needs_key_frame(struct taxel_compact *compact)
{
    struct taxel_compact_pending_key_frame *pending = &compact->pending;
    if (!pending->is_pending) {
        return !compact->has_key_frame || compact->updates < TAXEL_COMPACT_UPDATES_MAX || compact->is_size_raised ||
               compact->reads_since_key_frame >= PERIOD;
    }
    if (compact->reader_has_key_frame && compact->is_unread) {
        return true; /* the pending key frame is replaced before it was read */
    }
    if (compact->reads_since_key_frame <= pending->timeout_reads) {
        return false;
    }
    if (pending->timeout_reads < TIMEOUT_READS_MAX) { /* the acknowledgement may take longer than this timeout */
        pending->timeout_reads = (uint8_t)(2u * pending->timeout_reads);
    }
    return true;
}

/* Record whether the `size` in bytes of the encoded counts is clearly larger than the usual size, which indicates a
 * touch: by more than an eighth plus 2 bytes. Then adapt the usual size, downwards at once and upwards by 1/32 of the
 * difference. */
static void update_usual_size(struct taxel_compact *compact, size_t size)
{
    const uint16_t now = (uint16_t)(16u * size); /* in sixteenths of a byte, as usual_size */
    compact->is_size_raised = 8u * now > 9u * (uint32_t)compact->usual_size + 256u; /* 256: 8 times 2 bytes */
    if (now < compact->usual_size) {
        compact->usual_size = now;
    } else {
        compact->usual_size = (uint16_t)(compact->usual_size + ((now - compact->usual_size) >> 5));
    }
}

/* Encode a delta frame to `bytes`; returns its number of bytes without the CRC. Returns 0 if there is no key frame, if
 * the key frame is older than ELAPSED_MAX (microseconds), or if a packed frame (`packed_size` bytes) is not longer. */
static size_t code_delta(struct taxel_sensor *sensor, const struct taxel_snapshot_header *snapshot,
                         const uint8_t *counts, size_t packed_size, uint8_t *bytes)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t low = snapshot->timestamp_us;
    const struct taxel_compact_delta head = {
        .sequence = snapshot->sequence,
        .key_frame = compact->key_frame_id,
        .timestamp_low = {(uint8_t)low, (uint8_t)(low >> 8), (uint8_t)(low >> 16)},
    };
    size_t size = 0;
    if (!compact->has_key_frame || snapshot->timestamp_us - compact->key_frame_us > ELAPSED_MAX ||
        !taxel_compact_encode(sensor->config->compact.states, counts, sensor->config->taxel_count,
                              bytes + TAXEL_COMPACT_DELTA_SIZE, packed_size - TAXEL_COMPACT_DELTA_SIZE, &size)) {
        return 0;
    }
    update_usual_size(compact, size);
    taxel_compact_delta_pack(&head, bytes);
    return TAXEL_COMPACT_DELTA_SIZE + size;
}

/* Write a packed snapshot (header, then each count with `width` bits, without reference to a key frame) to `bytes`.
 * `counts`: 2 bytes each. */
static void pack_snapshot(const struct taxel_sensor *sensor, const struct taxel_snapshot_header *snapshot,
                          const uint8_t *counts, uint8_t width, uint8_t *bytes)
{
    const struct taxel_compact_packed head = {
        .sequence = snapshot->sequence,
        .format = width,
        .timestamp_us = snapshot->timestamp_us,
    };
    taxel_compact_packed_pack(&head, bytes);
    taxel_compact_pack(counts, sensor->config->taxel_count, width, bytes + TAXEL_COMPACT_PACKED_SIZE);
}

/* Add length byte, padding and CRC to the `size` bytes of a compact snapshot in `buffer`; returns the id of the
 * snapshot, the low half of the CRC. Large snapshots are padded to a multiple of TAXEL_COMPACT_LENGTH_STEP, so that one
 * byte can state every length. */
static uint16_t add_length_and_crc(const struct taxel_sensor *sensor, uint8_t *buffer, size_t size)
{
    size_t length = size + CRC_SIZE;
    while (length >= TAXEL_COMPACT_LENGTH_FINE && length % TAXEL_COMPACT_LENGTH_STEP) {
        buffer[1u + length++ - CRC_SIZE] = 0;
    }
    buffer[0] =
        (uint8_t)(length < TAXEL_COMPACT_LENGTH_FINE ? length
                                                     : TAXEL_COMPACT_LENGTH_FINE + length / TAXEL_COMPACT_LENGTH_STEP);
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &sensor->config->address, 1), buffer + 1, length - CRC_SIZE);
    taxel_put_u32(buffer + 1u + length - CRC_SIZE, crc);
    return (uint16_t)crc;
}

/* Store the data that are needed when the host acknowledges this snapshot as a key frame: one residual byte per taxel,
 * or, for a packed key frame, the new states themselves. */
static void store_key_frame(struct taxel_sensor *sensor, const uint8_t *counts, bool is_delta)
{
    const struct taxel_compact_memory *memory = &sensor->config->compact;
    for (size_t i = 0; i < sensor->config->taxel_count; i++) {
        const uint16_t count = taxel_get_u16(counts + 2u * i);
        if (is_delta) {
            memory->residuals[i] = taxel_compact_residual(memory->states[i], count);
        } else {
            memory->states[i] = taxel_compact_initial_state(count, sensor->compact.start_scale);
        }
    }
}

/* Discard the key frame, because a delta frame would be longer than a packed frame, and choose the initial scale
 * (expected spread of the counts) of the next key frame. If the discarded key frame had few updates, its initial scale
 * was too small: the next key frame begins with the next of the four scales, and the smallest follows the largest.
 * After many updates, the next key frame begins with the smallest scale. */
static void discard_key_frame(struct taxel_compact *compact)
{
    const bool is_young = compact->updates < TAXEL_COMPACT_UPDATES_MAX;
    const unsigned next = compact->start_scale + (1u << TAXEL_COMPACT_START_SHIFT);
    compact->start_scale = (uint8_t)(is_young ? next & TAXEL_COMPACT_START_MASK : 0u);
    compact->has_key_frame = false;
}

/* Encode a scan into the work buffer: as a delta frame if possible, otherwise packed. Also decide whether the new
 * snapshot is a key frame. A key frame becomes the pending key frame (not yet acknowledged by the host); its id, the
 * low half of the CRC, must differ from the ids in use. `bytes`: uncompressed snapshot. */
static void code_snapshot(struct taxel_sensor *sensor, const uint8_t *bytes)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint8_t *counts = bytes + TAXEL_SNAPSHOT_HEADER_SIZE;
    struct taxel_snapshot_header snapshot;
    taxel_snapshot_header_unpack(&snapshot, bytes);
    const uint8_t width = taxel_compact_width(counts, sensor->config->taxel_count);
    const size_t packed_size =
        TAXEL_COMPACT_PACKED_SIZE + taxel_compact_packed_size(width, sensor->config->taxel_count);
    bool is_key_frame = needs_key_frame(compact);
    size_t size = code_delta(sensor, &snapshot, counts, packed_size, compact->work_buffer + 1);
    const bool is_delta = size != 0;
    if (!is_delta) {
        pack_snapshot(sensor, &snapshot, counts, width, compact->work_buffer + 1);
        size = packed_size;
        if (compact->has_key_frame) {
            discard_key_frame(compact);
            is_key_frame = true;
        }
    }
    if (is_key_frame) {
        compact->pending.is_pending = false; /* an acknowledgement of the earlier key frame is ignored from here on */
        compact->work_buffer[1u + TAXEL_COMPACT_HEADER_OFFSET_FORMAT] |=
            TAXEL_COMPACT_KEY_FRAME | (is_delta ? 0u : compact->start_scale);
    }
    uint16_t id = add_length_and_crc(sensor, compact->work_buffer, size);
    if (is_key_frame && (id == compact->pending.id || (is_delta && id == compact->key_frame_id))) {
        is_key_frame = false; /* the id already identifies another snapshot */
        compact->work_buffer[1u + TAXEL_COMPACT_HEADER_OFFSET_FORMAT] &= TAXEL_COMPACT_WIDTH_MASK;
        id = add_length_and_crc(sensor, compact->work_buffer, size);
    }
    if (is_key_frame) {
        store_key_frame(sensor, counts, is_delta);
        compact->pending.is_pending = true;
        compact->pending.is_packed = !is_delta;
        compact->pending.id = id;
        compact->pending.timestamp_us = snapshot.timestamp_us;
    }
    compact->work_is_key_frame = is_key_frame;
    compact->work_ready = true;
}

/* Make the newly encoded compact snapshot available for reading, unless a read is in progress. */
static void exchange_buffers(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t interrupts = mask(sensor);
    if (!compact->read_in_progress) {
        uint8_t *const old_buffer = compact->reader_buffer;
        compact->reader_buffer = compact->work_buffer;
        compact->work_buffer = old_buffer;
        compact->reader_buffer_valid = compact->is_unread = true;
        compact->reader_has_key_frame = compact->work_is_key_frame;
        compact->reads_since_key_frame = compact->work_is_key_frame ? 0 : compact->reads_since_key_frame;
        compact->work_ready = false;
    }
    unmask(sensor, interrupts);
}

/* Return whether taxel_sensor_run() has work: an acknowledgement to process, a new scan to encode, or an encoded
 * snapshot to make available while no read is in progress. */
bool taxel_sensor_has_work(const struct taxel_sensor *sensor)
{
    const struct taxel_compact *compact = &sensor->compact;
    return taxel_sensor_has_compact(sensor) && (compact->acknowledge_received || compact->forget_received ||
                                                (compact->work_ready ? !compact->read_in_progress : may_latch(sensor)));
}

/* Process acknowledgements, encode the newest scan, and exchange the buffers when no read is in progress (main loop).
 * Does nothing if there is no work. */
void taxel_sensor_run(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    uint8_t latches = 0;
    if (!taxel_sensor_has_work(sensor)) { /* the usual case, which must not disable interrupts */
        return;
    }
    process_answers(sensor);
    if (!compact->work_ready && latch_newest(sensor, &latches)) {
        code_snapshot(sensor, sensor->scan.latched);
        if (latches != sensor->scan.latches) { /* a reader of uncompressed snapshots latched another scan meanwhile */
            compact->work_ready = compact->pending.is_pending = false;
        }
    }
    if (compact->work_ready) {
        exchange_buffers(sensor);
    }
}
