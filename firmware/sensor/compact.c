/* Compact snapshots: which one is a candidate, what happens to it, and the two buffers. A reader gets `shown`; the main loop
 * codes into `work` and exchanges them when no read is under way, so that neither waits for the other. */
#include "codec/crc32.h"
#include "sensor/sensor.h"

#define IDLE_US 10000000u     /* nobody has read for so long: nothing is coded */
#define PERIOD 16u            /* snapshots from candidate to candidate on a quiet skin: an acknowledgement costs 4 bytes of bus */
#define PATIENCE_FIRST 8u
#define PATIENCE_MAX 32u
#define ELAPSED_MAX 0xFFFFFFu /* since the reference: the timestamp's low three bytes say no more */
#define CRC_SIZE 4u

static uint32_t mask(const struct taxel_sensor *sensor)
{
    return sensor->config->hal->interrupts_disable(sensor->config->hal->context);
}

static void unmask(const struct taxel_sensor *sensor, uint32_t interrupts)
{
    sensor->config->hal->interrupts_restore(sensor->config->hal->context, interrupts);
}

static uint32_t clock_us(const struct taxel_sensor *sensor)
{
    return sensor->config->hal->clock_us(sensor->config->hal->context);
}

bool taxel_sensor_has_compact(const struct taxel_sensor *sensor)
{
    return sensor->config->compact.states && sensor->config->taxel_count <= TAXEL_COMPACT_TAXELS_MAX;
}

void taxel_sensor_compact_init(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    compact->shown = sensor->config->compact.buffers[0];
    compact->work = sensor->config->compact.buffers[1];
    compact->candidate.patience = PATIENCE_FIRST;
}

void taxel_sensor_compact_begin_read(struct taxel_sensor *sensor, bool again)
{
    static const uint8_t nothing_new;
    struct taxel_compact *compact = &sensor->compact;
    struct taxel_slave *slave = &sensor->slave;
    compact->asked_us = clock_us(sensor);
    compact->coding = true;
    slave->source_position = 0;
    if (!compact->unread && !(again && compact->has_shown)) {
        slave->source = &nothing_new;
        slave->source_size = 1;
        return;
    }
    if (compact->unread) {
        compact->unread = false;
        compact->reads = (uint8_t)(compact->reads + (compact->reads < UINT8_MAX));
        slave->snapshot_reads++;
    }
    compact->reading = true;
    slave->source = compact->shown;
    slave->source_size = 1u + (size_t)taxel_compact_size(compact->shown[0]);
}

void taxel_sensor_compact_end_read(struct taxel_sensor *sensor)
{
    sensor->compact.reading = false;
}

bool taxel_sensor_compact_write(struct taxel_sensor *sensor, const uint8_t *bytes, size_t size)
{
    struct taxel_compact *compact = &sensor->compact;
    if (size == TAXEL_COMPACT_ACKNOWLEDGE_SIZE) {
        compact->acknowledged_name = taxel_get_u16(bytes);
        compact->acknowledged = true;
        return true;
    }
    compact->forget = compact->forget || (size == 1 && bytes[0] == 0);
    return size == 1 && bytes[0] == 0;
}

static void take_candidate(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    const struct taxel_compact_memory *memory = &sensor->config->compact;
    for (size_t i = 0; i < sensor->config->taxel_count && !compact->candidate.begins; i++) {
        memory->states[i] = taxel_compact_learn(memory->states[i], memory->residuals[i], compact->updates);
    }
    if (compact->candidate.begins) {
        compact->updates = 1;
        compact->usual_size = UINT16_MAX;
    } else if (compact->updates < TAXEL_COMPACT_UPDATES_MAX) {
        compact->updates++;
    }
    compact->candidate.waits = false;
    compact->has_reference = true;
    compact->reference_name = compact->candidate.name;
    compact->reference_us = compact->candidate.timestamp_us;
}

/* What was written since the last call. The states change here only: never under a coder's hands. */
static void take_answers(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t interrupts = mask(sensor);
    const bool acknowledged = compact->acknowledged, forget = compact->forget;
    const uint16_t name = compact->acknowledged_name;
    compact->acknowledged = compact->forget = false;
    compact->unread = compact->unread && !forget; /* nobody could decode it */
    unmask(sensor, interrupts);
    if (acknowledged && compact->candidate.waits && compact->candidate.name == name) {
        take_candidate(sensor);
    }
    if (forget) {
        compact->has_reference = compact->candidate.waits = compact->ready = false;
        compact->candidate.patience = PATIENCE_FIRST;
    }
}

/* The reader of a plain snapshot block by block keeps it: nothing is latched while its pointer stands there. */
static bool may_latch(const struct taxel_sensor *sensor)
{
    const uint8_t pointer = sensor->slave.pointer;
    return sensor->compact.coding && sensor->scan.has_newest &&
           (pointer < TAXEL_REGISTER_SNAPSHOT || pointer > TAXEL_REGISTER_SNAPSHOT_LAST);
}

static bool take_newest(struct taxel_sensor *sensor, uint8_t *latches)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t interrupts = mask(sensor);
    if (compact->coding && clock_us(sensor) - compact->asked_us > IDLE_US) {
        compact->coding = compact->unread = compact->has_shown = false;
    }
    const bool taken = may_latch(sensor);
    if (taken) {
        taxel_scan_latch(sensor);
        *latches = sensor->scan.latches;
    }
    unmask(sensor, interrupts);
    return taken;
}

static bool wants_candidate(struct taxel_compact *compact)
{
    struct taxel_compact_candidate *candidate = &compact->candidate;
    if (!candidate->waits) {
        return !compact->has_reference || compact->updates < TAXEL_COMPACT_UPDATES_MAX || compact->busy ||
               compact->reads >= PERIOD;
    }
    if (compact->shows_candidate && compact->unread) {
        return true; /* it is replaced before anybody saw it */
    }
    if (compact->reads <= candidate->patience) {
        return false;
    }
    if (candidate->patience < PATIENCE_MAX) { /* perhaps the answer takes longer than this board waits */
        candidate->patience = (uint8_t)(2u * candidate->patience);
    }
    return true;
}

/* Whether the skin moves: coded counts take clearly more than the least that they took lately. */
static void note_size(struct taxel_compact *compact, size_t size)
{
    const uint16_t now = (uint16_t)(16u * size);
    compact->busy = 8u * now > 9u * (uint32_t)compact->usual_size + 256u;
    if (now < compact->usual_size) {
        compact->usual_size = now;
    } else {
        compact->usual_size = (uint16_t)(compact->usual_size + ((now - compact->usual_size) >> 5));
    }
}

/* Bytes from `sequence` up to the CRC, or 0: without a reference, or longer than packed. */
static size_t code(struct taxel_sensor *sensor, const struct taxel_snapshot_header *snapshot, const uint8_t *counts,
                   size_t packed_size, uint8_t *bytes)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t low = snapshot->timestamp_us;
    const struct taxel_compact_coded head = {
        .sequence = snapshot->sequence,
        .reference = compact->reference_name,
        .timestamp_low = {(uint8_t)low, (uint8_t)(low >> 8), (uint8_t)(low >> 16)},
    };
    size_t size = 0;
    if (!compact->has_reference || snapshot->timestamp_us - compact->reference_us > ELAPSED_MAX ||
        !taxel_compact_encode(sensor->config->compact.states, counts, sensor->config->taxel_count,
                              bytes + TAXEL_COMPACT_CODED_SIZE, packed_size - TAXEL_COMPACT_CODED_SIZE, &size)) {
        return 0;
    }
    note_size(compact, size);
    taxel_compact_coded_pack(&head, bytes);
    return TAXEL_COMPACT_CODED_SIZE + size;
}

static void pack(const struct taxel_sensor *sensor, const struct taxel_snapshot_header *snapshot, const uint8_t *counts,
                 uint8_t width, uint8_t *bytes)
{
    const struct taxel_compact_packed head = {
        .sequence = snapshot->sequence,
        .form = width,
        .timestamp_us = snapshot->timestamp_us,
    };
    taxel_compact_packed_pack(&head, bytes);
    taxel_compact_pack(counts, sensor->config->taxel_count, width, bytes + TAXEL_COMPACT_PACKED_SIZE);
}

/* Length byte, zeros to fill up, CRC; returns the name. */
static uint16_t seal(const struct taxel_sensor *sensor, uint8_t *buffer, size_t size)
{
    size_t length = size + CRC_SIZE;
    while (length >= TAXEL_COMPACT_LENGTH_FINE && length % TAXEL_COMPACT_LENGTH_STEP) {
        buffer[1u + length++ - CRC_SIZE] = 0;
    }
    buffer[0] = (uint8_t)(length < TAXEL_COMPACT_LENGTH_FINE
                              ? length
                              : TAXEL_COMPACT_LENGTH_FINE + length / TAXEL_COMPACT_LENGTH_STEP);
    const uint32_t crc = taxel_crc32(taxel_crc32(0, &sensor->config->address, 1), buffer + 1, length - CRC_SIZE);
    taxel_put_u32(buffer + 1u + length - CRC_SIZE, crc);
    return (uint16_t)crc;
}

/* What the acknowledgement will need: a byte a taxel, or the states themselves where there is no reference to keep. */
static void remember(struct taxel_sensor *sensor, const uint8_t *counts, bool coded)
{
    const struct taxel_compact_memory *memory = &sensor->config->compact;
    for (size_t i = 0; i < sensor->config->taxel_count; i++) {
        const uint16_t count = taxel_get_u16(counts + 2u * i);
        if (coded) {
            memory->residuals[i] = taxel_compact_residual(memory->states[i], count);
        } else {
            memory->states[i] = taxel_compact_begin(count, sensor->compact.start);
        }
    }
}

/* Coding against it takes more than packing. If it had not learned long, it began from too small a scale. */
static void forget_reference(struct taxel_compact *compact)
{
    const bool is_young = compact->updates < TAXEL_COMPACT_UPDATES_MAX;
    const unsigned next = compact->start + (1u << TAXEL_COMPACT_START_SHIFT);
    compact->start = (uint8_t)(is_young ? next & TAXEL_COMPACT_START_MASK : 0u);
    compact->has_reference = false;
}

static void code_snapshot(struct taxel_sensor *sensor, const uint8_t *bytes)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint8_t *counts = bytes + TAXEL_SNAPSHOT_HEADER_SIZE;
    struct taxel_snapshot_header snapshot;
    taxel_snapshot_header_unpack(&snapshot, bytes);
    const uint8_t width = taxel_compact_width(counts, sensor->config->taxel_count);
    const size_t packed_size = TAXEL_COMPACT_PACKED_SIZE + taxel_compact_packed_size(width, sensor->config->taxel_count);
    bool is_candidate = wants_candidate(compact);
    size_t size = code(sensor, &snapshot, counts, packed_size, compact->work + 1);
    const bool coded = size != 0;
    if (!coded) {
        pack(sensor, &snapshot, counts, width, compact->work + 1);
        size = packed_size;
        if (compact->has_reference) {
            forget_reference(compact);
            is_candidate = true;
        }
    }
    if (is_candidate) {
        compact->candidate.waits = false; /* an acknowledgement of the one before comes too late from here on */
        compact->work[1u + TAXEL_COMPACT_HEADER_OFFSET_FORM] |= TAXEL_COMPACT_CANDIDATE | (coded ? 0u : compact->start);
    }
    uint16_t name = seal(sensor, compact->work, size);
    if (is_candidate && (name == compact->candidate.name || (coded && name == compact->reference_name))) {
        is_candidate = false; /* a name that already means another snapshot */
        compact->work[1u + TAXEL_COMPACT_HEADER_OFFSET_FORM] &= TAXEL_COMPACT_WIDTH_MASK;
        name = seal(sensor, compact->work, size);
    }
    if (is_candidate) {
        remember(sensor, counts, coded);
        compact->candidate.waits = true;
        compact->candidate.begins = !coded;
        compact->candidate.name = name;
        compact->candidate.timestamp_us = snapshot.timestamp_us;
    }
    compact->ready_is_candidate = is_candidate;
    compact->ready = true;
}

/* Exchange the buffers, unless a reader is at it. */
static void show(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    const uint32_t interrupts = mask(sensor);
    if (!compact->reading) {
        uint8_t *const shown = compact->shown;
        compact->shown = compact->work;
        compact->work = shown;
        compact->has_shown = compact->unread = true;
        compact->shows_candidate = compact->ready_is_candidate;
        compact->reads = compact->ready_is_candidate ? 0 : compact->reads;
        compact->ready = false;
    }
    unmask(sensor, interrupts);
}

bool taxel_sensor_has_work(const struct taxel_sensor *sensor)
{
    const struct taxel_compact *compact = &sensor->compact;
    return taxel_sensor_has_compact(sensor) &&
           (compact->acknowledged || compact->forget || (compact->ready ? !compact->reading : may_latch(sensor)));
}

void taxel_sensor_run(struct taxel_sensor *sensor)
{
    struct taxel_compact *compact = &sensor->compact;
    uint8_t latches = 0;
    if (!taxel_sensor_has_work(sensor)) { /* the usual case, which must not keep interrupts out */
        return;
    }
    take_answers(sensor);
    if (!compact->ready && take_newest(sensor, &latches)) {
        code_snapshot(sensor, sensor->scan.latched);
        if (latches != sensor->scan.latches) { /* a reader of plain snapshots took the buffer away meanwhile */
            compact->ready = compact->candidate.waits = false;
        }
    }
    if (compact->ready) {
        show(sensor);
    }
}
