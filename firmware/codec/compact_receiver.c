#include "codec/compact_receiver.h"

#include "codec/crc32.h"

#define REPEAT_AFTER 4u /* snapshots that may arrive before an answer takes effect on the board */
#define CRC_SIZE 4u
#define WIDTH_MAX 16u
#define TIME_LOW_MASK 0xFFFFFFu

/* Select the message that the host sends to the board (acknowledge the pending key frame, or forget all key frames),
 * and schedule its repetition after REPEAT_AFTER snapshots. */
static void set_answer(struct taxel_compact_receiver *receiver, enum taxel_compact_answer answer)
{
    receiver->answer = (uint8_t)answer;
    receiver->snapshots_until_repeat = REPEAT_AFTER;
}

/* Return whether the `format` byte of a compact snapshot is valid: its width (bits per packed count, 0 for a delta
 * frame) is permitted, and the start bits (initial value of the expected spread) are 0 except in a packed key frame. */
static bool format_is_valid(uint8_t format)
{
    const bool has_start = format & TAXEL_COMPACT_KEY_FRAME && format & TAXEL_COMPACT_WIDTH_MASK;
    return (format & TAXEL_COMPACT_WIDTH_MASK) <= WIDTH_MAX && (has_start || !(format & TAXEL_COMPACT_START_MASK));
}

/* Select the answer again when its repetition is due. Called for each snapshot that shows no effect of the answer sent
 * to the board, which may have been lost. */
static void repeat_answer_if_due(struct taxel_compact_receiver *receiver, enum taxel_compact_answer answer)
{
    if (receiver->snapshots_until_repeat) {
        receiver->snapshots_until_repeat--;
    } else {
        set_answer(receiver, answer);
    }
}

/* Discard current and pending key frame, and request a new one from the board with a FORGET answer, which is repeated
 * at intervals. Always returns TAXEL_COMPACT_NO_KEY_FRAME. */
static enum taxel_compact_result reject_without_key_frame(struct taxel_compact_receiver *receiver)
{
    if (receiver->key_frame.is_valid || receiver->pending.is_valid) {
        receiver->key_frame.is_valid = receiver->pending.is_valid = false;
        receiver->snapshots_until_repeat = 0;
    }
    repeat_answer_if_due(receiver, TAXEL_COMPACT_ANSWER_FORGET);
    return TAXEL_COMPACT_NO_KEY_FRAME;
}

/* Decode a packed snapshot, which needs no key frame, into `snapshot`. A packed snapshot marked as a key frame fills
 * the pending key frame and makes the current one invalid. Returns TAXEL_COMPACT_OK, or TAXEL_COMPACT_DAMAGED for too
 * few bytes. */
static enum taxel_compact_result receive_packed(struct taxel_compact_receiver *receiver, uint8_t taxels,
                                                const uint8_t *bytes, size_t size,
                                                struct taxel_compact_snapshot *snapshot)
{
    struct taxel_compact_packed head;
    taxel_compact_packed_unpack(&head, bytes);
    const uint8_t width = head.format & TAXEL_COMPACT_WIDTH_MASK;
    if (size < TAXEL_COMPACT_PACKED_SIZE + taxel_compact_packed_size(width, taxels) + CRC_SIZE) {
        return TAXEL_COMPACT_DAMAGED;
    }
    snapshot->timestamp_us = head.timestamp_us;
    taxel_compact_unpack(bytes + TAXEL_COMPACT_PACKED_SIZE, taxels, width, snapshot->counts);
    if (head.format & TAXEL_COMPACT_KEY_FRAME) { /* the board has discarded its earlier key frame */
        struct taxel_compact_key_frame *pending = &receiver->pending;
        receiver->key_frame.is_valid = false;
        pending->taxels = taxels;
        pending->updates = 1;
        for (size_t i = 0; i < taxels; i++) {
            pending->states[i] = taxel_compact_initial_state(snapshot->counts[i], head.format);
        }
    }
    return TAXEL_COMPACT_OK;
}

/* Derive the pending key frame from the current one and the counts of a delta frame, with the same integer arithmetic
 * as on the board. */
static void update_pending(struct taxel_compact_receiver *receiver, const uint16_t *counts)
{
    const struct taxel_compact_key_frame *key_frame = &receiver->key_frame;
    struct taxel_compact_key_frame *pending = &receiver->pending;
    pending->taxels = key_frame->taxels;
    for (size_t i = 0; i < key_frame->taxels; i++) {
        const uint8_t residual = taxel_compact_residual(key_frame->states[i], counts[i]);
        pending->states[i] = taxel_compact_update(key_frame->states[i], residual, key_frame->updates);
    }
    pending->updates = (uint8_t)(key_frame->updates + (key_frame->updates < TAXEL_COMPACT_UPDATES_MAX));
}

/* Decode a delta frame with the key frame whose id the frame contains, into `snapshot`. The first delta frame that
 * refers to the pending key frame proves that the board received the acknowledgement: the pending key frame becomes the
 * current one. A delta frame marked as a key frame proposes the next one, which is derived from its counts. Returns
 * TAXEL_COMPACT_OK, or TAXEL_COMPACT_NO_KEY_FRAME if the key frame is missing or does not fit the bytes. */
static enum taxel_compact_result receive_delta(struct taxel_compact_receiver *receiver, uint8_t taxels,
                                               const uint8_t *bytes, size_t size,
                                               struct taxel_compact_snapshot *snapshot)
{
    struct taxel_compact_key_frame *key_frame = &receiver->key_frame;
    struct taxel_compact_delta head;
    taxel_compact_delta_unpack(&head, bytes);
    if (receiver->pending.is_valid && receiver->pending.id == head.key_frame) {
        *key_frame = receiver->pending;
        receiver->pending.is_valid = false;
        receiver->answer = TAXEL_COMPACT_ANSWER_NONE;
    }
    if (!key_frame->is_valid || key_frame->id != head.key_frame || key_frame->taxels != taxels ||
        !taxel_compact_decode(key_frame->states, taxels, bytes + TAXEL_COMPACT_DELTA_SIZE,
                              size - TAXEL_COMPACT_DELTA_SIZE - CRC_SIZE, snapshot->counts)) {
        return reject_without_key_frame(receiver);
    }
    const uint32_t low = taxel_get_u16(head.timestamp_low) | ((uint32_t)head.timestamp_low[2] << 16);
    snapshot->timestamp_us = key_frame->timestamp_us + ((low - key_frame->timestamp_us) & TIME_LOW_MASK);
    if (head.format & TAXEL_COMPACT_KEY_FRAME) {
        update_pending(receiver, snapshot->counts);
    } else if (receiver->pending.is_valid) {
        repeat_answer_if_due(receiver, TAXEL_COMPACT_ANSWER_ACKNOWLEDGE);
    }
    return TAXEL_COMPACT_OK;
}

/* Decode one compact snapshot (`size` bytes with CRC) of a board into sequence number, time and counts, and prepare the
 * answer that the host is to send. The CRC-32 covers the I2C address and the bytes; its low 16 bits are the id of a key
 * frame. */
enum taxel_compact_result taxel_compact_receive(struct taxel_compact_receiver *receiver, uint8_t address,
                                                uint8_t taxels, const uint8_t *bytes, size_t size,
                                                struct taxel_compact_snapshot *snapshot)
{
    if (size < TAXEL_COMPACT_OVERHEAD_DELTA || taxels == 0 || taxels > TAXEL_COMPACT_TAXELS_MAX) {
        return TAXEL_COMPACT_DAMAGED;
    }
    const uint32_t crc = taxel_get_u32(bytes + size - CRC_SIZE);
    struct taxel_compact_header head;
    taxel_compact_header_unpack(&head, bytes);
    if (crc != taxel_crc32(taxel_crc32(0, &address, 1), bytes, size - CRC_SIZE) || !format_is_valid(head.format)) {
        return TAXEL_COMPACT_DAMAGED;
    }
    snapshot->sequence = head.sequence;
    const enum taxel_compact_result result = head.format & TAXEL_COMPACT_WIDTH_MASK
                                                 ? receive_packed(receiver, taxels, bytes, size, snapshot)
                                                 : receive_delta(receiver, taxels, bytes, size, snapshot);
    /* A board never marks a snapshot as a key frame if its id equals that of the current key frame. */
    const bool id_is_used = receiver->key_frame.is_valid && receiver->key_frame.id == (uint16_t)crc;
    if (result == TAXEL_COMPACT_OK && head.format & TAXEL_COMPACT_KEY_FRAME && id_is_used) {
        receiver->pending.is_valid = false;
    } else if (result == TAXEL_COMPACT_OK && head.format & TAXEL_COMPACT_KEY_FRAME) {
        receiver->pending.is_valid = true;
        receiver->pending.id = (uint16_t)crc;
        receiver->pending.timestamp_us = snapshot->timestamp_us;
        set_answer(receiver, TAXEL_COMPACT_ANSWER_ACKNOWLEDGE);
    }
    return result;
}
