/* Fuzz target: compares the decoder for the original hub with the definition of its framing rule on arbitrary streams.
 *
 * The first byte of the input selects the format, the second the pieces in which the stream arrives; the other bytes
 * are parts of the stream: raw bytes, messages of a board with bytes of the input or with bytes that are frequent in
 * headers, headers without an end, and repetitions. Two formats have messages of a few bytes, which overlap often.
 * Invariants:
 *   - messages and counters equal those of the definition, which compares every candidate with every other;
 *   - messages do not overlap, and their bytes and the discarded bytes are the whole stream;
 *   - the pieces of the stream do not matter, and no access is out of bounds. */
#include "codec/original.h"
#include "fuzz/fuzz.h"

#define STREAM_MAX 1536u
#define PARTS_MAX 64u
#define CANDIDATES_MAX (STREAM_MAX / 3u + 1u)
#define HEADER 3u

struct candidate {
    size_t start, end;
    uint32_t time_ms;
    bool is_strong;   /* a plausible time, or a header behind it */
    bool is_accepted; /* no candidate that overlaps it has a greater rank */
};

struct expected {
    struct candidate candidates[CANDIDATES_MAX];
    size_t candidate_count, accepted_count, covered, rejected;
};

static const struct taxel_original_format dense = {
    .taxels = {[0x01] = 3, [0x0A] = 1, [0x0B] = 2, [0x10] = 4, [0x12] = 5, [0x1D] = 6},
    .has_timestamp = true,
};
static const struct taxel_original_format dense_untimed = {
    .taxels = {[0x01] = 3, [0x0A] = 1, [0x0B] = 2, [0x10] = 4, [0x12] = 5, [0x1D] = 6, [0x7F] = 125},
    .accelerations = {[0x0B] = 3, [0x01] = 3},
    .is_big_endian = true,
};
static const struct taxel_original_format *const formats[] = {
    &dense,
    &dense_untimed,
    &taxel_format_original,
    &taxel_format_original_accelerations,
    &taxel_format_first_generation,
    &taxel_format_first_generation_test,
    &taxel_format_first_generation_untimed,
    &taxel_format_fingertip_records,
};

static const struct taxel_original_format *format;
static uint8_t stream[STREAM_MAX];
static size_t stream_size;
static struct expected expected;
static size_t next_candidate; /* the first candidate that the decoder has not passed */
static uint64_t delivered, delivered_end;

/* ---- the stream ---- */

/* Append `size` bytes to the stream and return a pointer to them; NULL, and no change, if there is no space. */
static uint8_t *reserve(size_t size)
{
    if (size > STREAM_MAX - stream_size) {
        return NULL;
    }
    stream_size += size;
    return stream + stream_size - size;
}

/* Return a pseudo-random byte out of those that are frequent in headers: start and end bytes, addresses and lengths. */
static uint8_t sample_frequent(uint64_t *state)
{
    static const uint8_t frequent[] = {0x01, 0x0A, 0x00, 0x0C, 0x0E, 0x10, 0x12, 0x14, 0x1D, 0x24, 0x3E, 0xFA, 0x15};
    return frequent[fuzz_next(state) % sizeof frequent];
}

/* Append a message of a board whose address comes from the input; nothing if there is no space. The data are
 * pseudo-random bytes or (`is_frequent`) bytes that are frequent in headers. Formats of fixed records without a header
 * get no header. */
static void append_message(struct fuzz_input *input, uint64_t *state, uint32_t time_ms, bool is_frequent)
{
    uint8_t address = fuzz_u8(input) % TAXEL_ORIGINAL_ADDRESSES;
    while (!format->taxels[address]) {
        address = (uint8_t)((address + 1u) % TAXEL_ORIGINAL_ADDRESSES);
    }
    const size_t length = taxel_original_length(format, address);
    uint8_t *bytes = reserve(length);
    if (!bytes) {
        return;
    }
    for (size_t i = 0; i < length; i++) {
        bytes[i] = is_frequent ? sample_frequent(state) : fuzz_next(state);
    }
    if (format->record_size) {
        return;
    }
    bytes[0] = 0x01;
    bytes[1] = (uint8_t)length;
    bytes[2] = address;
    if (format->has_timestamp) {
        for (size_t i = 0; i < 4u; i++) {
            bytes[HEADER + i] = (uint8_t)(time_ms >> (24u - 8u * i));
        }
    }
    bytes[length - 1u] = 0x0A;
}

/* Build the stream from the parts that the input describes. The times begin near the wrap of 32 bits or after a late
 * start; their steps include the limit of is_plausible(), 60000 ms, and the first step beyond this limit. */
static void build_stream(struct fuzz_input *input)
{
    uint64_t state = fuzz_u8(input);
    uint32_t time_ms = fuzz_u8(input) & 1u ? 0xFFFFFF00u : 70000u;
    stream_size = 0;
    for (size_t part = 0; part < PARTS_MAX && input->remaining; part++) {
        const uint8_t kind = fuzz_u8(input);
        const size_t size = kind >> 3;
        static const uint32_t steps_ms[] = {0, 12, 60000, 60001};
        switch (kind & 7u) {
        case 0:
        case 1:
            time_ms += steps_ms[size & 3u];
            append_message(input, &state, time_ms, kind & 1u);
            break;
        case 2: /* a message that loses its last bytes */
            append_message(input, &state, time_ms, size & 1u);
            stream_size -= size < stream_size ? size : stream_size;
            break;
        case 3: { /* a repetition of the last bytes */
            const size_t count = 8u * size < stream_size ? 8u * size : stream_size;
            uint8_t *bytes = reserve(count);
            if (bytes) {
                memmove(bytes, bytes - count, count);
            }
            break;
        }
        case 4: /* bytes that are frequent in headers */
            for (size_t i = 0; i < size && stream_size < STREAM_MAX; i++) {
                stream[stream_size++] = sample_frequent(&state);
            }
            break;
        case 5: /* a changed byte among the last ones */
            if (size < stream_size) {
                stream[stream_size - 1u - size] = fuzz_u8(input);
            }
            break;
        default: /* bytes of the input */
            for (size_t i = 0; i < size && stream_size < STREAM_MAX; i++) {
                stream[stream_size++] = fuzz_u8(input);
            }
        }
    }
}

/* ---- the definition ---- */

/* Return the length in bytes of the message whose header begins at `start`; 0 if no header begins there. A message
 * consists of start byte 0x01, length, address, a timestamp of 4 bytes in some formats, the words, and end byte. */
static size_t header_length(size_t start)
{
    if (start + HEADER > stream_size || stream[start] != 0x01 || stream[start + 2u] >= TAXEL_ORIGINAL_ADDRESSES) {
        return 0;
    }
    const uint8_t address = stream[start + 2u];
    const size_t words = (size_t)format->taxels[address] + format->accelerations[address];
    const size_t length = (format->has_timestamp ? 8u : 4u) + 2u * words;
    return format->taxels[address] && length == stream[start + 1u] ? length : 0;
}

/* Return whether position `end` is followed by a header, by the end of the stream, or by the beginning of a header that
 * the end of the stream cuts off. The first two bytes of a header are the start byte 0x01 and a length. */
static bool is_followed(size_t end)
{
    if (end + HEADER <= stream_size) {
        return header_length(end) != 0;
    }
    if (end + 2u == stream_size) {
        bool is_length = false;
        for (uint8_t address = 0; address < TAXEL_ORIGINAL_ADDRESSES; address++) {
            is_length |= taxel_original_length(format, address) == stream[end + 1u];
        }
        return stream[end] == 0x01 && is_length;
    }
    return end == stream_size || stream[end] == 0x01;
}

/* Return whether two candidates have bytes in common. */
static bool overlap(const struct candidate *a, const struct candidate *b)
{
    return a->start < b->end && b->start < a->end;
}

/* Return whether no candidate found so far overlaps this one and has a greater rank. A strong candidate has a greater
 * rank than a weak one; of two equally strong candidates, the later one has the greater rank. */
static bool is_best(const struct candidate *candidate)
{
    for (size_t i = 0; i < expected.candidate_count; i++) {
        const struct candidate *other = &expected.candidates[i];
        const bool has_greater_rank =
            other->is_strong != candidate->is_strong ? other->is_strong : other->start > candidate->start;
        if (overlap(candidate, other) && has_greater_rank) {
            return false;
        }
    }
    return true;
}

/* Return whether a time in milliseconds is at most one minute after the hub's start, or after one of the last four
 * messages that end before `start`. */
static bool is_plausible(uint32_t time_ms, size_t start)
{
    size_t references = 0;
    bool result = time_ms <= 60000u;
    for (size_t i = expected.candidate_count; i-- && references < 4u;) {
        const struct candidate *other = &expected.candidates[i];
        if (other->end <= start && is_best(other)) {
            references++;
            result |= (uint32_t)(time_ms - other->time_ms) <= 60000u;
        }
    }
    return result;
}

/* Fill `expected` by the definition of the framing rule: find all candidates (possible messages from a header to the
 * end byte 0x0A), then accept each candidate that overlaps no candidate of greater rank. */
static void define_result(void)
{
    memset(&expected, 0, sizeof expected);
    for (size_t start = 0; start < stream_size; start++) {
        const size_t length = header_length(start);
        if (!length) {
            continue;
        }
        if (start + length > stream_size || stream[start + length - 1u] != 0x0A) {
            expected.rejected++;
            continue;
        }
        struct candidate candidate = {.start = start, .end = start + length};
        if (format->has_timestamp) {
            for (size_t i = 0; i < 4u; i++) {
                candidate.time_ms = candidate.time_ms << 8 | stream[start + HEADER + i];
            }
            candidate.is_strong = is_plausible(candidate.time_ms, start);
        } else {
            candidate.is_strong = is_followed(candidate.end);
        }
        FUZZ_CHECK(expected.candidate_count < CANDIDATES_MAX);
        expected.candidates[expected.candidate_count++] = candidate;
    }
    for (size_t i = 0; i < expected.candidate_count; i++) {
        struct candidate *candidate = &expected.candidates[i];
        candidate->is_accepted = is_best(candidate);
        expected.accepted_count += candidate->is_accepted;
        expected.covered += candidate->is_accepted ? candidate->end - candidate->start : 0;
    }
}

/* ---- the decoder ---- */

/* Handler of the decoder under test: compare a message with the stream, and with the next accepted candidate of the
 * definition (formats of fixed records: with the position of the next record of 50 bytes). */
static void on_message(void *context, const struct taxel_original_message *message)
{
    (void)context;
    const size_t words = (size_t)message->taxel_count + message->acceleration_count;
    const size_t head = format->record_size ? 0 : HEADER + (format->has_timestamp ? 4u : 0u);
    FUZZ_CHECK(message->position >= delivered_end);
    FUZZ_CHECK(message->position + head + 2u * words <= stream_size);
    FUZZ_CHECK(memcmp(message->words, stream + message->position + head, 2u * words) == 0);
    if (format->record_size) {
        FUZZ_CHECK(message->position == delivered * 50u);
        delivered_end = message->position + 50u;
    } else {
        while (next_candidate < expected.candidate_count && !expected.candidates[next_candidate].is_accepted) {
            next_candidate++;
        }
        FUZZ_CHECK(next_candidate < expected.candidate_count);
        const struct candidate *candidate = &expected.candidates[next_candidate++];
        FUZZ_CHECK(message->position == candidate->start);
        FUZZ_CHECK(message->timestamp_ms == candidate->time_ms);
        FUZZ_CHECK(message->address == stream[candidate->start + 2u]);
        FUZZ_CHECK(message->is_time_plausible == (format->has_timestamp && candidate->is_strong));
        FUZZ_CHECK(candidate->start + head + 2u * words + 1u == candidate->end);
        delivered_end = candidate->end;
    }
    delivered++;
}

/* Decode the stream in pieces of `piece` bytes (0: of 1, 2, 3, ... bytes), and compare the counters with those
 * expected. */
static void decode(size_t piece)
{
    static uint8_t buffer[TAXEL_ORIGINAL_BUFFER_MIN];
    static struct taxel_original_decoder decoder;
    const struct taxel_original_config config = {
        .buffer = buffer,
        .capacity = sizeof buffer,
        .format = format,
        .handler = on_message,
    };
    next_candidate = 0;
    delivered = 0;
    delivered_end = 0;
    FUZZ_CHECK(taxel_original_init(&decoder, &config) == 0);
    for (size_t at = 0, step = piece ? piece : 1u; at < stream_size; at += step, step += !piece) {
        taxel_original_push(&decoder, stream + at, step < stream_size - at ? step : stream_size - at);
        FUZZ_CHECK(decoder.fill < sizeof buffer);
    }
    taxel_original_finish(&decoder);
    FUZZ_CHECK(decoder.messages == delivered);
    FUZZ_CHECK(decoder.covered == stream_size);
    if (format->record_size) {
        FUZZ_CHECK(delivered == stream_size / 50u && decoder.discarded_bytes == stream_size % 50u);
        return;
    }
    FUZZ_CHECK(delivered == expected.accepted_count);
    FUZZ_CHECK(decoder.discarded_bytes == stream_size - expected.covered);
    FUZZ_CHECK(decoder.rejected_candidates == expected.rejected);
    FUZZ_CHECK(decoder.ambiguous_candidates == expected.candidate_count - expected.accepted_count);
}

/* Run one fuzz input: select a format, build a stream, and decode it at once and in pieces. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct fuzz_input input = {.bytes = bytes, .remaining = size};
    format = formats[fuzz_u8(&input) % (sizeof formats / sizeof formats[0])];
    const size_t piece = fuzz_u8(&input);
    build_stream(&input);
    define_result();
    decode(STREAM_MAX);
    decode(piece);
    return 0;
}
