#include "fuzz/codec_oracle.h"

#include "fuzz/fuzz.h"

struct type_rule {
    uint8_t type;
    uint8_t has_address;       /* the payload begins with the I2C address of a board */
    uint16_t minimum, maximum; /* length of the payload in bytes */
};

/* SPEC.md, "Frame types". */
static const struct type_rule type_rules[] = {
    {0x01, 0, 24, 24}, {0x02, 1, 20, 498}, {0x03, 1, 20, 496}, {0x08, 0, 42, 42}, {0x09, 1, 39, 39},
    {0x0A, 0, 66, 66}, {0x0B, 1, 10, 10},  {0x0C, 1, 13, 13},  {0x0D, 0, 7, 71},  {0x0E, 0, 3, 131},
    {0x81, 0, 3, 3},   {0x82, 0, 2, 68},   {0x83, 0, 3, 66},
};

/* Return the rule of a frame type, or NULL if the type is undefined or is not sent in one of the accepted `directions`.
 * Types from 0x80 on are sent by the host. */
static const struct type_rule *rule_of(uint8_t type, uint8_t directions)
{
    for (size_t i = 0; i < sizeof type_rules / sizeof type_rules[0]; i++) {
        if (type_rules[i].type == type &&
            directions & (type < 0x80 ? TAXEL_DIRECTION_TO_HOST : TAXEL_DIRECTION_TO_HUB)) {
            return &type_rules[i];
        }
    }
    return NULL;
}

/* Return whether the frame type is sent in one of `directions` and permits a payload of `length` bytes. */
bool oracle_allows(uint8_t type, uint8_t directions, size_t length)
{
    const struct type_rule *rule = rule_of(type, directions);
    return rule && length >= rule->minimum && length <= rule->maximum;
}

/* Read a little-endian 32-bit number from 4 bytes. */
static uint32_t u32_at(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

/* Read a little-endian 16-bit number from 2 bytes. */
static uint16_t u16_at(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] | bytes[1] << 8);
}

/* Return whether a body (a frame without stuffing: type, sequence, length, payload, CRC) is valid in this protocol
 * version: type, length, I2C address and number of taxels are checked. A body is 9 bytes longer than its payload, which
 * begins at byte 5. A payload TAXELS (type 0x02) has 18 bytes and 2 for each taxel; byte 1 of this payload is the
 * number of taxels. The numbers of SPEC.md are repeated here, so that the oracle is independent of the deframer under
 * test. */
static bool is_body_known(const uint8_t *body, size_t size, uint8_t directions)
{
    const struct type_rule *rule = rule_of(body[0], directions);
    const size_t length = size - 9;
    if (!oracle_allows(body[0], directions, length) || (rule->has_address && (body[5] < 0x08 || body[5] > 0x77))) {
        return false;
    }
    return body[0] != 0x02 || length == 18u + 2u * body[6];
}

/* Unstuff and unwhiten the complete frame that begins at `bytes`. Returns the length of its body and, in `taken`, the
 * number of stuffed bytes; 0 if no frame with a valid CRC begins there. Stuffing of SPEC.md (COBS): a code byte n
 * stands before n - 1 data bytes and, unless n is 255, one removed zero. Whitening sequence of SPEC.md: k[0] = 0xA5,
 * k[i+1] = 5 k[i] + 0x6B modulo 256. A payload has at most 498 bytes; the body is 9 bytes longer. */
static size_t body_at(const uint8_t *bytes, size_t size, uint8_t *body, size_t *taken)
{
    size_t length = 0, expected = 0, position = 0;
    uint8_t whitening = 0xA5;
    while (position < size) {
        const size_t end = position + bytes[position];
        const bool is_full = bytes[position] == 0xFF;
        if (end > size) {
            return 0;
        }
        for (size_t i = position + 1; i < end; i++) {
            if (length == TAXEL_BODY_MAX) {
                return 0;
            }
            body[length++] = bytes[i] ^ whitening;
            whitening = (uint8_t)(5 * whitening + 0x6B);
        }
        position = end;
        if (!expected && length >= 5) {
            if (u16_at(body + 3) > 498u) {
                return 0;
            }
            expected = 9u + u16_at(body + 3);
        }
        if (expected && length >= expected) {
            *taken = position;
            return length == expected && fuzz_crc32(0, body, length - 4) == u32_at(body + length - 4) ? length : 0;
        }
        if (!is_full) {
            if (length == TAXEL_BODY_MAX) {
                return 0;
            }
            body[length++] = whitening; /* a zero, unwhitened */
            whitening = (uint8_t)(5 * whitening + 0x6B);
        }
    }
    return 0;
}

/* Append a complete frame to the expected frames, and its payload to the expected payloads. */
static void add_frame(struct oracle *oracle, const uint8_t *body, size_t size, uint8_t directions)
{
    FUZZ_CHECK(oracle->frame_count < ORACLE_FRAMES_MAX);
    oracle->frames[oracle->frame_count++] = (struct oracle_frame){
        .type = body[0],
        .sequence = u16_at(body + 1),
        .length = (uint16_t)(size - 9),
        .offset = oracle->payload_size,
        .is_unknown = !is_body_known(body, size, directions),
        .is_of_other_direction = !(directions & (body[0] < 0x80 ? TAXEL_DIRECTION_TO_HOST : TAXEL_DIRECTION_TO_HUB)),
    };
    memcpy(oracle->payloads + oracle->payload_size, body + 5, size - 9);
    oracle->payload_size += size - 9;
}

/* Search the bytes between two delimiters for frames, starting at each byte in turn. Bytes that belong to no frame are
 * counted as discarded. */
static void search_chunk(struct oracle *oracle, const uint8_t *bytes, size_t size, uint8_t directions)
{
    uint8_t body[TAXEL_BODY_MAX];
    size_t start = 0;
    while (start < size) {
        size_t taken = 0;
        const size_t length = body_at(bytes + start, size - start, body, &taken);
        if (length) {
            add_frame(oracle, body, length, directions);
            start += taken;
        } else {
            oracle->discarded_bytes++;
            start++;
        }
    }
}

struct board_history {
    bool exists;
    uint16_t cycle, scan;
};

/* Compute the flags and the number of missing frames of a frame with taxel data, and add both to the totals of its
 * board. The frame is damaged if the board's CRC in its snapshot is wrong. `history` contains cycle and scan number of
 * the last frame of each board, indexed by I2C address.
 * Missing frames are the frames that the board should have sent between its last frame and this frame. Their number is
 * the smaller of two differences from the last frame, minus 1: the difference of the cycle numbers and the difference
 * of the scan numbers. For a compact frame (type 0x03) the difference of the scan numbers is first reduced by 1,
 * because a board that is coding a snapshot has no frame to send. */
static void count_board(struct oracle *oracle, struct oracle_frame *frame, struct board_history *history)
{
    struct taxel_batch_totals *totals = &oracle->totals;
    const uint8_t *payload = oracle->payloads + frame->offset;
    const uint8_t address = payload[0];
    const uint16_t cycle = u16_at(payload + 2), scan = u16_at(payload + 8);
    const uint32_t crc = fuzz_crc32(fuzz_crc32(0, payload, 1), payload + 8, frame->length - 12u);
    const bool is_damaged = crc != u32_at(payload + frame->length - 4);
    oracle->has_compact = oracle->has_compact || (frame->type == 0x03 && !is_damaged);
    frame->flags |= is_damaged ? TAXEL_BATCH_BOARD_CRC_BAD : 0;
    totals->damaged[address] += is_damaged;
    totals->received[address] += !is_damaged;
    if (history[address].exists) {
        const uint16_t cycles = (uint16_t)(cycle - history[address].cycle),
                       scans = (uint16_t)(scan - history[address].scan);
        const uint16_t counted_scans = frame->type == 0x03 && scans ? (uint16_t)(scans - 1) : scans;
        const uint16_t steps = cycles < counted_scans ? cycles : counted_scans;
        frame->missing_before = steps ? (uint16_t)(steps - 1) : 0;
        totals->missing[address] += frame->missing_before;
    }
    history[address] = (struct board_history){true, cycle, scan};
}

/* Read the hub's uptime in microseconds, 8 little-endian bytes at `payload`. */
static uint64_t read_uptime(const uint8_t *payload)
{
    uint64_t uptime_us = 0;
    for (int i = 7; i >= 0; i--) {
        uptime_us = uptime_us << 8 | payload[i];
    }
    return uptime_us;
}

/* Return whether a known frame reports a restart of the hub: a handshake with sequence number 0 and tag 0, or a
 * handshake with a shorter uptime than before. Also updates `last_uptime_us` from handshakes and hub status frames. */
static bool is_restart(const struct oracle *oracle, const struct oracle_frame *frame, uint64_t *last_uptime_us)
{
    const uint8_t *payload = oracle->payloads + frame->offset;
    bool restarts = frame->type == 0x01 && frame->sequence == 0 && payload[0] == 0;
    if (frame->type == 0x01) {
        restarts = restarts || read_uptime(payload + 16) < *last_uptime_us;
        *last_uptime_us = read_uptime(payload + 16);
    } else if (frame->type == 0x08) {
        *last_uptime_us = read_uptime(payload);
    }
    return restarts;
}

/* Compute the expected number of lost frames before each frame from the sequence numbers, and all totals. Frames of the
 * other direction are skipped, because they have their own sequence numbers. Unknown frames are included, because they
 * have the sequence numbers of their sender. No decoder delivers unknown frames, so the number of frames lost before an
 * unknown frame (`before_unknown`) is stated with the next known frame. */
static void count_losses(struct oracle *oracle)
{
    struct board_history history[TAXEL_BATCH_ADDRESSES] = {{0}};
    const struct oracle_frame *previous = NULL;
    uint16_t before_unknown = 0;
    uint64_t last_uptime_us = 0;
    for (size_t i = 0; i < oracle->frame_count; i++) {
        struct oracle_frame *frame = &oracle->frames[i];
        oracle->totals.unknown += frame->is_unknown;
        if (frame->is_of_other_direction) {
            continue;
        }
        const uint16_t lost = previous ? (uint16_t)(frame->sequence - previous->sequence - 1) : 0;
        oracle->totals.frames++;
        if (frame->is_unknown) {
            before_unknown = (uint16_t)(before_unknown + lost);
            oracle->totals.lost += lost;
        } else if (is_restart(oracle, frame, &last_uptime_us)) {
            memset(history, 0, sizeof history);
            frame->flags |= previous ? TAXEL_BATCH_HUB_RESTARTED : 0;
            oracle->totals.restarts += previous != NULL;
            before_unknown = 0;
        } else {
            frame->lost_before = (uint16_t)(lost + before_unknown);
            oracle->totals.lost += lost;
            before_unknown = 0;
        }
        previous = frame;
        if (!frame->is_unknown && (frame->type == 0x02 || frame->type == 0x03)) {
            count_board(oracle, frame, history);
        }
    }
}

/* Remove the unknown frames, which no decoder delivers, from the expected frames. */
static void remove_unknown(struct oracle *oracle)
{
    size_t kept = 0;
    for (size_t i = 0; i < oracle->frame_count; i++) {
        if (!oracle->frames[i].is_unknown) {
            oracle->frames[kept++] = oracle->frames[i];
        }
    }
    oracle->frame_count = kept;
}

/* Decode a stream in the simplest possible way. The result in `oracle` (frames, payloads, totals, discarded bytes) is
 * the expectation with which the optimised decoders are compared. */
void oracle_decode(struct oracle *oracle, const uint8_t *bytes, size_t size, uint8_t directions)
{
    size_t start = 0;
    oracle->frame_count = oracle->payload_size = 0;
    oracle->discarded_bytes = 0;
    oracle->has_compact = false;
    memset(&oracle->totals, 0, sizeof oracle->totals);
    while (start < size) {
        const uint8_t *zero = memchr(bytes + start, 0, size - start);
        const size_t end = zero ? (size_t)(zero - bytes) : size;
        search_chunk(oracle, bytes + start, end - start, directions);
        start = end + 1;
    }
    count_losses(oracle);
    remove_unknown(oracle);
}
