/* Fuzz target: compares every decoder of the codec with an independent oracle on arbitrary streams.
 *
 * The input is either a stream, or a script that builds a stream from frames of any type and payload, random bytes,
 * and damage (flip, insert, delete, duplicate, truncate, lost delimiters), so that mutations need not guess a CRC.
 * Invariants:
 *   - the deframer, given the stream in pieces of sizes from the input (or at once), delivers the oracle's frames in
 *     the same order and discards the same number of bytes (codec_oracle.h);
 *   - the batch decoder, with arrays of the smallest allowed size, delivers the same frames and counts the same losses;
 *   - each decoded frame, encoded again into a ring that wraps at any position, decodes to itself;
 *   - any payload is encoded without a zero byte, into no more bytes than the stated maximum;
 *   - the CRC and whitening of the boards (small) equal those of the PC (fast);
 *   - every fixed layout packs the values that it has unpacked. */
#include "codec/crc32.h"
#include "codec/encoder.h"
#include "codec/whitening.h"
#include "fuzz/codec_oracle.h"
#include "fuzz/fuzz.h"
#include "generated_fields.h"

/* The implementations of the boards, under separate names. */
#define taxel_crc32 small_crc32
#define taxel_whiten small_whiten
#include "codec/crc32_small.c"
#include "codec/whitening_small.c"
#undef taxel_crc32
#undef taxel_whiten

#define STEPS_MAX 96u
#define WIRE_MAX (TAXEL_ENCODED_MAX + 2u)
#define SIZES_MAX 8u
#define ROWS_MIN 128u
#define ROWS_MAX (ROWS_MIN + 64u)
#define COUNTS_MIN (3u * TAXEL_BATCH_CHUNK_SIZE / 2u / 30u * TAXEL_COMPACT_TAXELS_MAX + 1u)
#define PAYLOADS_MIN (3u * TAXEL_BATCH_CHUNK_SIZE / 2u + 1u)
#define LAYOUT_MAX 256u

static uint8_t stream[ORACLE_STREAM_MAX];
static size_t stream_size;
/* the stream at the end of the array, so that a sanitizer detects an access behind it */
static uint8_t aligned_stream[ORACLE_STREAM_MAX];
static const uint8_t *data;
static struct oracle oracle;
static uint8_t chunk[TAXEL_BATCH_CHUNK_SIZE], body[TAXEL_BODY_MAX];
static struct taxel_batch batch;
static struct taxel_batch_row taxel_rows[ROWS_MAX], message_rows[ROWS_MAX];
static uint16_t counts[COUNTS_MIN];
static uint8_t payloads[PAYLOADS_MIN];

/* Append bytes to the stream; bytes without space are ignored. */
static void append(const uint8_t *bytes, size_t size)
{
    const size_t space = sizeof stream - stream_size;
    const size_t taken = size < space ? size : space;
    memcpy(stream + stream_size, bytes, taken);
    stream_size += taken;
}

/* Fill `payload`, mostly with a length that the frame type permits, and return the length. The first 0 to 12 bytes come
 * from the input; the others are pseudo-random, bytes of the stream, or a constant. Bits of the input select a valid
 * I2C address and a valid CRC of the board. */
static size_t make_payload(struct fuzz_input *input, uint8_t type, uint8_t *payload)
{
    const uint8_t filling = fuzz_u8(input); /* bits: 0 random, 1 stream, 2 and 3 input bytes, 4 to 7 constant */
    const uint16_t wish = fuzz_u16(input);
    uint64_t state = wish;
    size_t length = wish % (TAXEL_PAYLOAD_MAX + 1u);
    /* take the next length that the type permits; 3: both directions (to the host and to the hub) */
    for (size_t tries = 0; !oracle_allows(type, 3, length) && tries <= TAXEL_PAYLOAD_MAX; tries++) {
        length = (length + 1u) % (TAXEL_PAYLOAD_MAX + 1u);
    }
    for (size_t i = 0; i < length; i++) {
        payload[i] = filling & 1u                        ? fuzz_next(&state)
                     : (filling & 2u) && i < stream_size ? stream[i]
                                                         : (uint8_t)(filling >> 4);
    }
    (void)fuzz_bytes(input, payload, length < (filling >> 2 & 3u) * 4u ? length : (filling >> 2 & 3u) * 4u);
    if (type == TAXEL_FRAME_TYPE_TAXELS) {
        payload[1] = (uint8_t)((length - TAXEL_TAXEL_HEADER_SIZE - TAXEL_SNAPSHOT_OVERHEAD) / 2u);
        length = TAXEL_TAXEL_HEADER_SIZE + TAXEL_SNAPSHOT_OVERHEAD + 2u * (size_t)payload[1];
    }
    if (wish & 0x8000u) {
        payload[0] = (uint8_t)(TAXEL_ADDRESS_MIN + payload[0] % (TAXEL_ADDRESS_MAX - TAXEL_ADDRESS_MIN + 1u));
    }
    if (type == TAXEL_FRAME_TYPE_TAXELS && wish & 0x4000u) {
        fuzz_put_u32(payload + length - 4, fuzz_crc32(fuzz_crc32(0, payload, 1), payload + 8, length - 12u));
    }
    return length;
}

/* Append one encoded frame with a payload from the fuzz input to the stream. `op` selects the type (bits 4 to 7) and
 * omits the first (bit 2) or last (bit 3) delimiter. Also checks that the encoded frame has no zero between the
 * delimiters, that it is no longer than the stated maximum, and that a shorter buffer is refused. */
static void append_frame(struct fuzz_input *input, uint8_t op)
{
    /* frame types (enum taxel_frame_type); repeated types are appended more often */
    static const uint8_t types[16] = {0x01, 0x02, 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0D,
                                      0x0E, 0x81, 0x82, 0x02, 0x02, 0x0E, 0x0D, 0x03};
    uint8_t payload[TAXEL_PAYLOAD_MAX + 1u], wire[WIRE_MAX];
    const uint8_t type = types[op >> 4];
    const uint16_t sequence = fuzz_u16(input);
    const size_t length = make_payload(input, type, payload);
    const size_t size = taxel_batch_encode(type, sequence, payload, (uint16_t)length, wire, sizeof wire);
    FUZZ_CHECK(size && size <= taxel_encoded_size_max(length));
    FUZZ_CHECK(wire[0] == 0 && wire[size - 1u] == 0 && !memchr(wire + 1, 0, size - 2u));
    FUZZ_CHECK(
        taxel_batch_encode(type, sequence, payload, (uint16_t)length, wire, taxel_encoded_size_max(length) - 1u) == 0);
    /* delimiters may be missing */
    append(wire + (op & 4u ? 1u : 0u), size - (op & 4u ? 1u : 0u) - (op & 8u ? 1u : 0u));
}

/* Damage the stream at a position from the fuzz input. Bits 4 to 6 of `op` select the damage: change, remove or insert
 * a byte, repeat a part, truncate, or add a constant to a run of bytes. */
static void damage_stream(struct fuzz_input *input, uint8_t op)
{
    const size_t back = fuzz_u16(input);
    const uint8_t value = fuzz_u8(input);
    if (!stream_size) {
        return;
    }
    const size_t at = stream_size - 1u - back % stream_size;
    switch (op >> 4 & 7u) {
    case 0:
        stream[at] = (uint8_t)(stream[at] ^ value);
        break;
    case 1:
        stream[at] = value;
        break;
    case 2:
        memmove(stream + at, stream + at + 1u, stream_size - at - 1u);
        stream_size--;
        break;
    case 3:
        if (stream_size < sizeof stream) {
            memmove(stream + at + 1u, stream + at, stream_size - at);
            stream[at] = value;
            stream_size++;
        }
        break;
    case 4: {
        uint8_t copy[256];
        const size_t size = stream_size - at < value ? stream_size - at : value;
        memcpy(copy, stream + at, size);
        append(copy, size);
        break;
    }
    case 5:
        stream_size = at;
        break;
    default:
        for (size_t i = at; i < stream_size && i < at + (value & 31u); i++) {
            stream[i] = (uint8_t)(stream[i] + value);
        }
        break;
    }
}

/* Append bytes that are not encoded as a frame: from the fuzz input (bit 2 of `op`), or pseudo-random. */
static void append_random_bytes(struct fuzz_input *input, uint8_t op)
{
    uint64_t state = fuzz_u16(input);
    uint8_t bytes[16];
    if (op & 4u) {
        append(bytes, fuzz_bytes(input, bytes, op >> 4));
        return;
    }
    for (size_t i = 0; i < 8u * (op >> 4); i++) {
        bytes[0] = (uint8_t)(fuzz_next(&state) | (op >> 3 & 1u)); /* half of the runs contain no zero */
        append(bytes, 1);
    }
}

/* Build a stream of frames and damage from the steps in the fuzz input. */
static void build_stream(struct fuzz_input *input)
{
    for (unsigned step = 0; input->remaining && step < STEPS_MAX; step++) {
        const uint8_t op = fuzz_u8(input);
        switch (op & 3u) {
        case 0:
        case 1:
            append_frame(input, op);
            break;
        case 2:
            damage_stream(input, op);
            break;
        default:
            append_random_bytes(input, op);
            break;
        }
    }
}

static size_t frames_decoded; /* by the decoder under test */

/* Handler of the deframer: the frame must be the next one that the oracle expects. */
static void expect_frame(void *context, const struct taxel_frame *frame)
{
    (void)context;
    FUZZ_CHECK(frames_decoded < oracle.frame_count);
    const struct oracle_frame *expected = &oracle.frames[frames_decoded++];
    FUZZ_CHECK(frame->type == expected->type && frame->sequence == expected->sequence &&
               frame->length == expected->length);
    FUZZ_CHECK(memcmp(frame->payload, oracle.payloads + expected->offset, frame->length) == 0);
}

/* Decode the stream with the deframer in pieces, and compare frames and counters with the oracle. A byte n of `sizes`
 * gives a piece of n * n / 8 + 1 bytes, so that short and long pieces occur; without sizes there is one piece. */
static void check_deframer(uint8_t directions, const uint8_t *sizes, size_t size_count)
{
    const struct taxel_deframer_config config = {
        .chunk = chunk,
        .chunk_capacity = sizeof chunk,
        .body = body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = directions,
        .handler = expect_frame,
    };
    struct taxel_deframer deframer;
    size_t position = 0;
    taxel_deframer_init(&deframer, &config);
    frames_decoded = 0;
    for (size_t i = 0; position < stream_size; i++) {
        const size_t wish = size_count ? (size_t)sizes[i % size_count] * sizes[i % size_count] / 8u + 1u : stream_size;
        const size_t size = wish < stream_size - position ? wish : stream_size - position;
        taxel_deframer_push(&deframer, data + position, size);
        position += size;
        FUZZ_CHECK(deframer.fill <= sizeof chunk && deframer.position == position);
    }
    taxel_deframer_finish(&deframer);
    FUZZ_CHECK(frames_decoded == oracle.frame_count && deframer.frames == oracle.frame_count);
    FUZZ_CHECK(deframer.discarded_bytes == oracle.discarded_bytes && deframer.fill == 0);
}

/* Return whether frames of this type carry the raw counts of a board. */
static bool carries_taxels(uint8_t type)
{
    return type == TAXEL_FRAME_TYPE_TAXELS || type == TAXEL_FRAME_TYPE_COMPACT_TAXELS;
}

/* Compare a row of the batch decoder (one decoded frame), and its counts or its payload, with the frame that the oracle
 * expects. */
static void check_row(const struct taxel_batch_row *row, const struct oracle_frame *expected,
                      const struct taxel_batch_output *output)
{
    const uint8_t *payload = oracle.payloads + expected->offset;
    FUZZ_CHECK(row->type == expected->type && row->sequence == expected->sequence && row->flags == expected->flags);
    FUZZ_CHECK(row->lost_before == expected->lost_before && row->missing_before == expected->missing_before);
    FUZZ_CHECK(row->stream_position <= stream_size);
    if (!carries_taxels(row->type)) {
        FUZZ_CHECK(row->size == expected->length && row->offset + row->size <= output->payload_count);
        FUZZ_CHECK(memcmp(payloads + row->offset, payload, row->size) == 0);
        return;
    }
    /* a damaged compact snapshot has no counts */
    const uint8_t size = row->type == TAXEL_FRAME_TYPE_TAXELS ? payload[1] : 0;
    FUZZ_CHECK(row->address == payload[0] && row->size == size && row->length == expected->length);
    FUZZ_CHECK(row->offset + row->size <= output->count_count);
    FUZZ_CHECK(row->cycle == (payload[2] | payload[3] << 8) && row->board_sequence == (payload[8] | payload[9] << 8));
    for (size_t i = 0; i < row->size; i++) {
        FUZZ_CHECK(counts[row->offset + i] == (payload[14u + 2u * i] | payload[15u + 2u * i] << 8));
    }
}

/* Check the two tables of one call of the batch decoder, taxel rows and message rows, each in the order of the stream.
 * `taxels` and `messages` are the indices of the next expected frame of each table, and are advanced. */
static void check_rows(const struct taxel_batch_output *output, size_t *taxels, size_t *messages)
{
    FUZZ_CHECK(output->taxel_count <= output->row_capacity && output->message_count <= output->row_capacity);
    FUZZ_CHECK(output->count_count <= output->count_capacity && output->payload_count <= output->payload_capacity);
    for (size_t i = 0; i < output->taxel_count; i++, (*taxels)++) {
        while (*taxels < oracle.frame_count && !carries_taxels(oracle.frames[*taxels].type)) {
            (*taxels)++;
        }
        FUZZ_CHECK(*taxels < oracle.frame_count);
        check_row(&taxel_rows[i], &oracle.frames[*taxels], output);
    }
    for (size_t i = 0; i < output->message_count; i++, (*messages)++) {
        while (*messages < oracle.frame_count && carries_taxels(oracle.frames[*messages].type)) {
            (*messages)++;
        }
        FUZZ_CHECK(*messages < oracle.frame_count);
        check_row(&message_rows[i], &oracle.frames[*messages], output);
    }
}

/* Decode the stream with the batch decoder in pieces, into tables with space for `rows` rows, and compare rows and
 * totals with the oracle. A byte n of `sizes` gives a piece of n * n / 8 + 1 bytes; without sizes: one piece. */
static void check_batch(uint8_t directions, size_t rows, const uint8_t *sizes, size_t size_count)
{
    struct taxel_batch_output output = {
        taxel_rows, message_rows, counts, payloads, rows, COUNTS_MIN, PAYLOADS_MIN, 0, 0, 0, 0};
    size_t position = 0, taxels = 0, messages = 0;
    if (oracle.has_compact) {
        return; /* a compact snapshot with a valid CRC: its content is tested by fuzz_compact */
    }
    taxel_batch_init(&batch, directions);
    for (size_t i = 0; position < stream_size; i++) {
        const size_t wish = size_count ? (size_t)sizes[i % size_count] * sizes[i % size_count] / 8u + 1u : stream_size;
        const size_t size = wish < stream_size - position ? wish : stream_size - position;
        const size_t taken = taxel_batch_decode(&batch, data + position, size, &output);
        FUZZ_CHECK(taken && taken <= size); /* empty arrays always have space for a step */
        check_rows(&output, &taxels, &messages);
        position += taken;
    }
    FUZZ_CHECK(taxel_batch_finish(&batch, &output));
    check_rows(&output, &taxels, &messages);
    FUZZ_CHECK(memcmp(taxel_batch_totals(&batch), &oracle.totals, sizeof oracle.totals) == 0);
    FUZZ_CHECK(taxel_batch_discarded_bytes(&batch) == oracle.discarded_bytes);
}

/* Encode each frame of the oracle again, into a ring buffer from position `wrap` (modulo its size) on, and check that
 * the deframer decodes the same frame and that the linear encoder gives the same bytes. */
static void check_encoded_again(size_t wrap)
{
    uint8_t ring[WIRE_MAX], wire[WIRE_MAX], again[WIRE_MAX];
    struct oracle_frame *const frames = oracle.frames;
    const struct taxel_deframer_config config = {
        .chunk = chunk,
        .chunk_capacity = sizeof chunk,
        .body = body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = 3, /* both: to the host and to the hub */
        .handler = expect_frame,
    };
    struct taxel_deframer deframer;
    taxel_deframer_init(&deframer, &config);
    frames_decoded = 0;
    for (size_t i = 0; i < oracle.frame_count; i++) {
        struct taxel_encoder encoder;
        const uint8_t *payload = oracle.payloads + frames[i].offset;
        const size_t half = frames[i].length / 2u;
        const size_t size =
            taxel_batch_encode(frames[i].type, frames[i].sequence, payload, frames[i].length, wire, sizeof wire);
        taxel_encoder_begin(&encoder, ring, sizeof ring, wrap % sizeof ring, frames[i].type, frames[i].sequence,
                            frames[i].length);
        taxel_encoder_put(&encoder, payload, half);
        taxel_encoder_put(&encoder, payload + half, frames[i].length - half);
        FUZZ_CHECK(taxel_encoder_end(&encoder) == size &&
                   taxel_encoder_position(&encoder) == (wrap % sizeof ring + size) % sizeof ring);
        for (size_t n = 0; n < size; n++) {
            again[n] = ring[(wrap + n) % sizeof ring];
        }
        FUZZ_CHECK(memcmp(wire, again, size) == 0);
        taxel_deframer_push(&deframer, wire, size);
        FUZZ_CHECK(frames_decoded == i + 1u && deframer.discarded_bytes == 0);
    }
}

/* Check that the fast CRC-32 and whitening of the host give the results of the small implementations of the boards; the
 * CRC is also compared with a third implementation (fuzz.h). */
static void check_arithmetic(void)
{
    uint8_t fast[TAXEL_BODY_MAX], small[TAXEL_BODY_MAX];
    const size_t size = stream_size < sizeof fast ? stream_size : sizeof fast;
    const size_t first = size / 3u;
    const uint32_t crc = taxel_crc32(taxel_crc32(0, data, first), data + first, size - first);
    FUZZ_CHECK(crc == small_crc32(0, data, size) && crc == fuzz_crc32(0, data, size));
    memcpy(fast, data, size);
    memcpy(small, data, size);
    taxel_whiten(fast + first, fast + first, first, size - first);
    small_whiten(small + first, small + first, first, size - first);
    FUZZ_CHECK(memcmp(fast, small, size) == 0);
}

/* Check for each packed struct of the protocol that unpacking and packing restores the same bytes. */
static void check_layouts(void)
{
    for (size_t i = 0; i < sizeof layouts / sizeof layouts[0]; i++) {
        union {
            uint64_t aligned;
            uint8_t bytes[LAYOUT_MAX];
        } value;
        uint8_t packed[LAYOUT_MAX];
        if (stream_size >= layouts[i].size) {
            layouts[i].unpack(&value, data);
            layouts[i].pack(&value, packed);
            FUZZ_CHECK(memcmp(packed, data, layouts[i].size) == 0);
        }
    }
}

/* Run one fuzz input: build or take a stream, decode it with oracle, deframer and batch decoder, and compare the
 * results. The stream ends at the end of its array, so that a sanitizer detects reads beyond it. Bits of `mode`: 0, 1
 * directions; 2, 3 rows of the tables; 4 whether the input is the stream; 5 to 7 number of piece sizes. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct fuzz_input input = {bytes, size};
    uint8_t sizes[SIZES_MAX];
    const uint8_t mode = fuzz_u8(&input);
    const uint8_t directions = (uint8_t)(1u + (mode & 3u) % 3u);
    const size_t size_count = fuzz_bytes(&input, sizes, mode >> 5);
    const size_t rows = ROWS_MIN + (mode >> 2 & 3u) * 16u;
    stream_size = 0;
    if (mode & 0x10u) {
        append(input.bytes, input.remaining);
    } else {
        build_stream(&input);
    }
    data = memcpy(aligned_stream + sizeof aligned_stream - stream_size, stream, stream_size);
    oracle_decode(&oracle, data, stream_size, directions);
    check_deframer(directions, sizes, size_count);
    check_batch(directions, rows, sizes, size_count);
    check_encoded_again(mode * 7u);
    check_arithmetic();
    check_layouts();
    return 0;
}
