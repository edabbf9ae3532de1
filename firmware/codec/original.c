#include "codec/original.h"

#include <string.h>

#define LENGTH_MAX 255u
#define MISSING SIZE_MAX /* the answer depends on bytes that have not arrived */

/* Return the length in bytes of a complete message of this board, which is also the value of its length field: start,
 * length, address, timestamp, words and end. 0: the format has no such board. */
size_t taxel_original_length(const struct taxel_original_format *format, uint8_t address)
{
    if (address >= TAXEL_ORIGINAL_ADDRESSES || !format->taxels[address]) {
        return 0;
    }
    if (format->record_size) {
        return format->record_size;
    }
    const size_t words = (size_t)format->taxels[address] + format->accelerations[address];
    return TAXEL_ORIGINAL_HEADER_SIZE + (format->has_timestamp ? TAXEL_ORIGINAL_TIMESTAMP_SIZE : 0u) + 2u * words + 1u;
}

/* Return count or acceleration number `index` of a message, in the byte order of its format. */
uint16_t taxel_original_word(const struct taxel_original_message *message, size_t index)
{
    const uint8_t *word = message->words + 2u * index;
    return (uint16_t)(message->is_big_endian ? word[0] << 8 | word[1] : word[1] << 8 | word[0]);
}

/* Initialise a decoder. Returns 0, or -1 if the buffer is too small or a message would be longer than 255 bytes. */
int taxel_original_init(struct taxel_original_decoder *decoder, const struct taxel_original_config *config)
{
    memset(decoder, 0, sizeof *decoder);
    decoder->config = *config;
    if (config->capacity < TAXEL_ORIGINAL_BUFFER_MIN) {
        return -1;
    }
    for (uint8_t address = 0; address < TAXEL_ORIGINAL_ADDRESSES; address++) {
        if (taxel_original_length(config->format, address) > LENGTH_MAX) {
            return -1;
        }
    }
    return 0;
}

/* Read the timestamp (ms, big-endian) of the candidate that begins at `start` in the buffer. */
static uint32_t time_of(const struct taxel_original_decoder *decoder, size_t start)
{
    const uint8_t *bytes = decoder->config.buffer + start + TAXEL_ORIGINAL_HEADER_SIZE;
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

/* Return whether a time is at most TAXEL_ORIGINAL_TIME_STEP_MAX_MS after the time of one of the last messages, or after
 * time 0, the start of the hub. */
static bool is_plausible(const struct taxel_original_decoder *decoder, uint32_t time_ms)
{
    if (time_ms <= TAXEL_ORIGINAL_TIME_STEP_MAX_MS) {
        return true;
    }
    for (uint8_t i = 0; i < decoder->time_count; i++) {
        if ((uint32_t)(time_ms - decoder->times[i]) <= TAXEL_ORIGINAL_TIME_STEP_MAX_MS) {
            return true;
        }
    }
    return false;
}

/* Return whether the messages of any board have this length. */
static bool is_length(const struct taxel_original_format *format, uint8_t length)
{
    for (uint8_t address = 0; address < TAXEL_ORIGINAL_ADDRESSES; address++) {
        if (taxel_original_length(format, address) == length) {
            return true;
        }
    }
    return false;
}

/* Return the length of the message whose header begins at `start` in the buffer; 0: no header begins there; MISSING:
 * the buffer ends inside a possible header. */
static size_t match_header(const struct taxel_original_decoder *decoder, size_t start)
{
    const struct taxel_original_format *format = decoder->config.format;
    const uint8_t *bytes = decoder->config.buffer + start;
    const size_t available = decoder->fill - start;
    if (available && bytes[0] != TAXEL_ORIGINAL_START) {
        return 0;
    }
    if (available >= TAXEL_ORIGINAL_HEADER_SIZE) {
        const size_t length = taxel_original_length(format, bytes[2]);
        return length == bytes[1] ? length : 0;
    }
    return available < 2u || is_length(format, bytes[1]) ? MISSING : 0;
}

/* Call the handler with an accepted candidate (bytes with a valid header and end byte) as a message. Also updates the
 * counters, and the times of the last messages, with which the next time must agree. */
static void accept(struct taxel_original_decoder *decoder, const struct taxel_original_candidate *candidate)
{
    const struct taxel_original_format *format = decoder->config.format;
    const uint8_t *bytes = decoder->config.buffer + candidate->start;
    const uint8_t address = format->record_size ? TAXEL_ORIGINAL_RECORD_ADDRESS : bytes[2];
    size_t offset = format->record_size ? 0 : TAXEL_ORIGINAL_HEADER_SIZE;
    uint32_t time_ms = 0;
    if (format->has_timestamp) {
        time_ms = time_of(decoder, candidate->start);
        offset += TAXEL_ORIGINAL_TIMESTAMP_SIZE;
        decoder->times[decoder->time_next] = time_ms;
        decoder->time_next = (uint8_t)((decoder->time_next + 1u) % TAXEL_ORIGINAL_REFERENCE_TIMES);
        if (decoder->time_count < TAXEL_ORIGINAL_REFERENCE_TIMES) {
            decoder->time_count++;
        }
    }
    const struct taxel_original_message message = {
        .words = bytes + offset,
        .position = decoder->base + candidate->start,
        .timestamp_ms = time_ms,
        .address = address,
        .taxel_count = format->taxels[address],
        .acceleration_count = format->accelerations[address],
        .is_big_endian = format->is_big_endian,
        .is_time_plausible = format->has_timestamp && candidate->has_evidence,
    };
    decoder->messages++;
    decoder->discarded_bytes += message.position - decoder->covered;
    decoder->covered = decoder->base + candidate->end;
    decoder->config.handler(decoder->config.context, &message);
}

/* Determine the evidence of a candidate in a format without timestamps: a header, or the end of the stream, directly
 * behind the candidate. Returns false, without a result, if the bytes behind it have not arrived. */
static bool find_follower(const struct taxel_original_decoder *decoder, struct taxel_original_candidate *candidate,
                          bool is_end)
{
    if (!candidate->is_known) {
        const size_t length = match_header(decoder, candidate->end);
        if (length == MISSING && !is_end) {
            return false;
        }
        candidate->is_known = true;
        candidate->has_evidence = length != 0; /* MISSING: the stream ends behind the candidate */
    }
    return true;
}

/* Compare a complete candidate (bytes with a valid header and end byte) with those before it that overlap it, and keep
 * the best one as `current`. A candidate with evidence (a plausible time, or a header behind it) is better than one
 * without; of two equal candidates, the later one is better. Each candidate that loses is counted as ambiguous.
 * `strong_end` is the farthest end of a candidate with evidence. Returns false, without a change, if bytes are missing
 * for the decision. */
static bool resolve(struct taxel_original_decoder *decoder, struct taxel_original_candidate candidate, bool is_end)
{
    struct taxel_original_candidate *current = decoder->has_current ? &decoder->current : NULL;
    if (decoder->config.format->has_timestamp) {
        candidate.is_known = true;
        candidate.has_evidence = is_plausible(decoder, time_of(decoder, candidate.start));
    } else if (current || decoder->strong_end > candidate.start) {
        if (!find_follower(decoder, &candidate, is_end) || (current && !find_follower(decoder, current, is_end))) {
            return false;
        }
    }
    if (current && current->has_evidence && current->end > decoder->strong_end) {
        decoder->strong_end = current->end;
    }
    const bool is_beaten = !candidate.has_evidence && decoder->strong_end > candidate.start;
    decoder->ambiguous_candidates += is_beaten;
    if (current && (candidate.has_evidence || !current->has_evidence)) {
        decoder->ambiguous_candidates++;
        decoder->has_current = false;
    }
    if (!is_beaten) {
        decoder->current = candidate;
        decoder->has_current = true;
    }
    if (candidate.has_evidence && candidate.end > decoder->strong_end) {
        decoder->strong_end = candidate.end;
    }
    return true;
}

/* Examine the start byte at `scan` (no header, a rejected or a complete candidate), and step over it. Returns false if
 * bytes are missing for the decision; at the end of the stream (`is_end`) none are missing. */
static bool examine_start(struct taxel_original_decoder *decoder, bool is_end)
{
    const size_t start = decoder->scan;
    const size_t length = match_header(decoder, start);
    if (length == MISSING || length > decoder->fill - start) {
        if (!is_end) {
            return false;
        }
        decoder->rejected_candidates += length != MISSING;
    } else if (length) {
        const struct taxel_original_candidate candidate = {.start = start, .end = start + length};
        if (decoder->config.buffer[candidate.end - 1u] != TAXEL_ORIGINAL_END) {
            decoder->rejected_candidates++;
        } else if (!resolve(decoder, candidate, is_end)) {
            return false;
        }
    }
    decoder->scan = start + 1u;
    return true;
}

/* Search the buffer for candidates (possible messages) and accept those that no better candidate overlaps, to the end
 * of the buffer or until bytes are missing for a decision. */
static void search(struct taxel_original_decoder *decoder, bool is_end)
{
    for (;;) {
        const size_t until = decoder->has_current ? decoder->current.end : decoder->fill;
        const uint8_t *from = decoder->config.buffer + decoder->scan;
        const uint8_t *start = memchr(from, TAXEL_ORIGINAL_START, until - decoder->scan);
        if (start) {
            decoder->scan += (size_t)(start - from);
            if (!examine_start(decoder, is_end)) {
                return;
            }
        } else {
            decoder->scan = until;
            if (!decoder->has_current) {
                return;
            }
            decoder->has_current = false;
            accept(decoder, &decoder->current);
        }
    }
}

/* Accept each `record_size` bytes of the buffer as one message: nothing in a stream without frames marks a start. Bytes
 * of an incomplete record at the end of the stream are skipped. */
static void split_records(struct taxel_original_decoder *decoder, bool is_end)
{
    const size_t size = decoder->config.format->record_size;
    while (decoder->fill - decoder->scan >= size) {
        const struct taxel_original_candidate record = {.start = decoder->scan, .end = decoder->scan + size};
        decoder->scan += size;
        accept(decoder, &record);
    }
    if (is_end) {
        decoder->scan = decoder->fill;
    }
}

/* Remove the bytes before the search position, or before the current candidate (a possible message), from the buffer.
 * Removed bytes that belong to no accepted message are counted as discarded. */
static void remove_settled_bytes(struct taxel_original_decoder *decoder)
{
    const size_t settled = decoder->has_current ? decoder->current.start : decoder->scan;
    if (!settled) {
        return;
    }
    if (decoder->base + settled > decoder->covered) {
        decoder->discarded_bytes += decoder->base + settled - decoder->covered;
        decoder->covered = decoder->base + settled;
    }
    memmove(decoder->config.buffer, decoder->config.buffer + settled, decoder->fill - settled);
    decoder->base += settled;
    decoder->fill -= settled;
    decoder->scan -= settled;
    decoder->strong_end = decoder->strong_end > settled ? decoder->strong_end - settled : 0;
    if (decoder->has_current) {
        decoder->current.start -= settled;
        decoder->current.end -= settled;
    }
}

/* Decode the bytes in the buffer, and remove those for which the decision is final. */
static void process(struct taxel_original_decoder *decoder, bool is_end)
{
    if (decoder->config.format->record_size) {
        split_records(decoder, is_end);
    } else {
        search(decoder, is_end);
    }
    remove_settled_bytes(decoder);
}

/* Take any number of stream bytes; each accepted message is passed to the handler. */
void taxel_original_push(struct taxel_original_decoder *decoder, const uint8_t *bytes, size_t size)
{
    while (size) {
        /* At most TAXEL_ORIGINAL_BUFFER_MIN - 1 bytes wait for a decision, so there is always space. */
        const size_t space = decoder->config.capacity - decoder->fill;
        const size_t step = size < space ? size : space;
        memcpy(decoder->config.buffer + decoder->fill, bytes, step);
        decoder->fill += step;
        bytes += step;
        size -= step;
        process(decoder, false);
    }
}

/* Decode the bytes that wait for a decision, as at the end of the stream. */
void taxel_original_finish(struct taxel_original_decoder *decoder)
{
    process(decoder, true);
}
