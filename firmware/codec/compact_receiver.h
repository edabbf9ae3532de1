/* What a host remembers of one board that sends compact snapshots, and what it answers (protocol/SPEC.md, "Compact snapshot"). */
#ifndef TAXEL_COMPACT_RECEIVER_H
#define TAXEL_COMPACT_RECEIVER_H

#include "codec/compact.h"

enum taxel_compact_result {
    TAXEL_COMPACT_OK = 0,
    TAXEL_COMPACT_DAMAGED,   /* the CRC is wrong, or no board makes these bytes */
    TAXEL_COMPACT_UNKNOWN,   /* coded against a reference that this host does not have */
};

enum taxel_compact_answer {
    TAXEL_COMPACT_ANSWER_NONE = 0,
    TAXEL_COMPACT_ANSWER_ACKNOWLEDGE,
    TAXEL_COMPACT_ANSWER_FORGET,
};

struct taxel_compact_reference {
    bool known;
    uint8_t taxels;
    uint8_t updates;
    uint16_t name;
    uint32_t timestamp_us;
    taxel_compact_state states[TAXEL_COMPACT_TAXELS_MAX];
};

struct taxel_compact_receiver {
    uint8_t answer; /* to be sent; whoever sends it sets it to NONE */
    uint8_t wait;   /* snapshots until the answer is said again, should it have no effect */
    struct taxel_compact_reference reference;
    struct taxel_compact_reference candidate; /* its name is that of the acknowledgement */
};

struct taxel_compact_snapshot {
    uint16_t sequence;
    uint32_t timestamp_us;
    uint16_t counts[TAXEL_COMPACT_TAXELS_MAX];
};

/* Decode a compact snapshot, from `sequence` to `crc32`. Unless the result is OK, nothing of *snapshot is to be believed. */
enum taxel_compact_result taxel_compact_receive(struct taxel_compact_receiver *receiver, uint8_t address, uint8_t taxels,
                                                const uint8_t *bytes, size_t size, struct taxel_compact_snapshot *snapshot);

#endif
