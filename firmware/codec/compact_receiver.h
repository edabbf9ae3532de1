/* A host's receiver of the compact snapshots of one board, and the acknowledgement that it sends back
 * (protocol/SPEC.md, "Compact snapshot").
 *
 * Integration (`bytes`: the payload of a COMPACT_TAXELS frame after its header; one receiver per board, all zeros at
 * first):
 *
 *     static struct taxel_compact_receiver receiver;
 *     struct taxel_compact_snapshot snapshot;
 *     if (taxel_compact_receive(&receiver, address, taxel_count, bytes, size, &snapshot) == TAXEL_COMPACT_OK) {
 *         use(snapshot.counts);
 *     }
 *     if (receiver.answer == TAXEL_COMPACT_ANSWER_ACKNOWLEDGE) {
 *         send_acknowledgement(address, receiver.pending.id);
 *     } else if (receiver.answer == TAXEL_COMPACT_ANSWER_FORGET) {
 *         send_acknowledgement(address | TAXEL_ACKNOWLEDGE_FORGET, 0);
 *     }
 *     receiver.answer = TAXEL_COMPACT_ANSWER_NONE;
 */
#ifndef TAXEL_COMPACT_RECEIVER_H
#define TAXEL_COMPACT_RECEIVER_H

#include "codec/compact.h"

enum taxel_compact_result {
    TAXEL_COMPACT_OK = 0,
    TAXEL_COMPACT_DAMAGED,      /* the CRC is wrong, or no board produces these bytes */
    TAXEL_COMPACT_NO_KEY_FRAME, /* a delta frame whose key frame this host does not have */
};

enum taxel_compact_answer {
    TAXEL_COMPACT_ANSWER_NONE = 0,
    TAXEL_COMPACT_ANSWER_ACKNOWLEDGE,
    TAXEL_COMPACT_ANSWER_FORGET,
};

/* State from which delta frames are decoded. */
struct taxel_compact_key_frame {
    bool is_valid;
    uint8_t taxels;
    uint8_t updates;
    uint16_t id; /* low 16 bits of the CRC-32 of the snapshot that produced this state */
    uint32_t timestamp_us;
    taxel_compact_state states[TAXEL_COMPACT_TAXELS_MAX];
};

struct taxel_compact_receiver {
    uint8_t answer;                 /* enum taxel_compact_answer: to be sent; the sender then sets NONE */
    uint8_t snapshots_until_repeat; /* snapshots after which an answer without effect is sent again */
    struct taxel_compact_key_frame key_frame;
    struct taxel_compact_key_frame pending; /* the last snapshot marked as a key frame; its id is acknowledged */
};

struct taxel_compact_snapshot {
    uint16_t sequence;
    uint32_t timestamp_us;
    uint16_t counts[TAXEL_COMPACT_TAXELS_MAX];
};

/* Decode a compact snapshot, from `sequence` to `crc32`. *snapshot is valid only if the result is TAXEL_COMPACT_OK. */
enum taxel_compact_result taxel_compact_receive(struct taxel_compact_receiver *receiver, uint8_t address,
                                                uint8_t taxels, const uint8_t *bytes, size_t size,
                                                struct taxel_compact_snapshot *snapshot);

#endif
