#include "codec/compact_receiver.h"

#include "codec/crc32.h"

#define PATIENCE 4u /* snapshots that an answer may take to reach the board */
#define CRC_SIZE 4u
#define WIDTH_MAX 16u
#define TIME_LOW_MASK 0xFFFFFFu

static void say(struct taxel_compact_receiver *receiver, enum taxel_compact_answer answer)
{
    receiver->answer = (uint8_t)answer;
    receiver->wait = PATIENCE;
}

static bool form_exists(uint8_t form)
{
    const bool begins = form & TAXEL_COMPACT_CANDIDATE && form & TAXEL_COMPACT_WIDTH_MASK;
    return (form & TAXEL_COMPACT_WIDTH_MASK) <= WIDTH_MAX && (begins || !(form & TAXEL_COMPACT_START_MASK));
}

/* This snapshot shows no effect of what was said, if it was: perhaps it was lost. */
static void remind(struct taxel_compact_receiver *receiver, enum taxel_compact_answer answer)
{
    if (receiver->wait) {
        receiver->wait--;
    } else {
        say(receiver, answer);
    }
}

static enum taxel_compact_result refuse_unknown(struct taxel_compact_receiver *receiver)
{
    if (receiver->reference.known || receiver->candidate.known) {
        receiver->reference.known = receiver->candidate.known = false;
        receiver->wait = 0;
    }
    remind(receiver, TAXEL_COMPACT_ANSWER_FORGET);
    return TAXEL_COMPACT_UNKNOWN;
}

static enum taxel_compact_result receive_packed(struct taxel_compact_receiver *receiver, uint8_t taxels, const uint8_t *bytes,
                                                size_t size, struct taxel_compact_snapshot *snapshot)
{
    struct taxel_compact_packed head;
    taxel_compact_packed_unpack(&head, bytes);
    const uint8_t width = head.form & TAXEL_COMPACT_WIDTH_MASK;
    if (size < TAXEL_COMPACT_PACKED_SIZE + taxel_compact_packed_size(width, taxels) + CRC_SIZE) {
        return TAXEL_COMPACT_DAMAGED;
    }
    snapshot->timestamp_us = head.timestamp_us;
    taxel_compact_unpack(bytes + TAXEL_COMPACT_PACKED_SIZE, taxels, width, snapshot->counts);
    if (head.form & TAXEL_COMPACT_CANDIDATE) { /* it begins anew: the board has no other reference any more */
        struct taxel_compact_reference *candidate = &receiver->candidate;
        receiver->reference.known = false;
        candidate->taxels = taxels;
        candidate->updates = 1;
        for (size_t i = 0; i < taxels; i++) {
            candidate->states[i] = taxel_compact_begin(snapshot->counts[i], head.form);
        }
    }
    return TAXEL_COMPACT_OK;
}

static void go_on(struct taxel_compact_receiver *receiver, const uint16_t *counts)
{
    const struct taxel_compact_reference *reference = &receiver->reference;
    struct taxel_compact_reference *candidate = &receiver->candidate;
    candidate->taxels = reference->taxels;
    for (size_t i = 0; i < reference->taxels; i++) {
        const uint8_t residual = taxel_compact_residual(reference->states[i], counts[i]);
        candidate->states[i] = taxel_compact_learn(reference->states[i], residual, reference->updates);
    }
    candidate->updates = (uint8_t)(reference->updates + (reference->updates < TAXEL_COMPACT_UPDATES_MAX));
}

static enum taxel_compact_result receive_coded(struct taxel_compact_receiver *receiver, uint8_t taxels, const uint8_t *bytes,
                                               size_t size, struct taxel_compact_snapshot *snapshot)
{
    struct taxel_compact_reference *reference = &receiver->reference;
    struct taxel_compact_coded head;
    taxel_compact_coded_unpack(&head, bytes);
    if (receiver->candidate.known && receiver->candidate.name == head.reference) {
        *reference = receiver->candidate;
        receiver->candidate.known = false;
        receiver->answer = TAXEL_COMPACT_ANSWER_NONE;
    }
    if (!reference->known || reference->name != head.reference || reference->taxels != taxels ||
        !taxel_compact_decode(reference->states, taxels, bytes + TAXEL_COMPACT_CODED_SIZE,
                              size - TAXEL_COMPACT_CODED_SIZE - CRC_SIZE, snapshot->counts)) {
        return refuse_unknown(receiver);
    }
    const uint32_t low = taxel_get_u16(head.timestamp_low) | ((uint32_t)head.timestamp_low[2] << 16);
    snapshot->timestamp_us = reference->timestamp_us + ((low - reference->timestamp_us) & TIME_LOW_MASK);
    if (head.form & TAXEL_COMPACT_CANDIDATE) {
        go_on(receiver, snapshot->counts);
    } else if (receiver->candidate.known) {
        remind(receiver, TAXEL_COMPACT_ANSWER_ACKNOWLEDGE);
    }
    return TAXEL_COMPACT_OK;
}

enum taxel_compact_result taxel_compact_receive(struct taxel_compact_receiver *receiver, uint8_t address, uint8_t taxels,
                                                const uint8_t *bytes, size_t size, struct taxel_compact_snapshot *snapshot)
{
    if (size < TAXEL_COMPACT_OVERHEAD_CODED || taxels == 0 || taxels > TAXEL_COMPACT_TAXELS_MAX) {
        return TAXEL_COMPACT_DAMAGED;
    }
    const uint32_t crc = taxel_get_u32(bytes + size - CRC_SIZE);
    struct taxel_compact_header head;
    taxel_compact_header_unpack(&head, bytes);
    if (crc != taxel_crc32(taxel_crc32(0, &address, 1), bytes, size - CRC_SIZE) || !form_exists(head.form)) {
        return TAXEL_COMPACT_DAMAGED;
    }
    snapshot->sequence = head.sequence;
    const enum taxel_compact_result result = head.form & TAXEL_COMPACT_WIDTH_MASK
                                                 ? receive_packed(receiver, taxels, bytes, size, snapshot)
                                                 : receive_coded(receiver, taxels, bytes, size, snapshot);
    const bool is_taken = receiver->reference.known && receiver->reference.name == (uint16_t)crc; /* no board does that */
    if (result == TAXEL_COMPACT_OK && head.form & TAXEL_COMPACT_CANDIDATE && is_taken) {
        receiver->candidate.known = false;
    } else if (result == TAXEL_COMPACT_OK && head.form & TAXEL_COMPACT_CANDIDATE) {
        receiver->candidate.known = true;
        receiver->candidate.name = (uint16_t)crc;
        receiver->candidate.timestamp_us = snapshot->timestamp_us;
        say(receiver, TAXEL_COMPACT_ANSWER_ACKNOWLEDGE);
    }
    return result;
}
