/* What a receiver should make of a whole stream: SPEC.md, "What a receiver does" and "Counting losses", written down a second
 * time with no buffer to run out of and no state to keep between bytes. Slow and plain, for the fuzz target to compare with. */
#ifndef TAXEL_CODEC_ORACLE_H
#define TAXEL_CODEC_ORACLE_H

#include "codec/batch.h"

#define ORACLE_STREAM_MAX 1536u /* half as much again as a receiver's buffer holds */
#define ORACLE_FRAMES_MAX (ORACLE_STREAM_MAX / 12u + 1u)

struct oracle_frame {
    uint8_t type;
    uint16_t sequence, length;
    size_t offset; /* of its payload in `payloads` */
    uint16_t lost_before, missing_before;
    uint8_t flags; /* enum taxel_batch_flag */
};

struct oracle {
    struct oracle_frame frames[ORACLE_FRAMES_MAX];
    size_t frame_count;
    uint8_t payloads[ORACLE_STREAM_MAX];
    size_t payload_size;
    uint64_t discarded_bytes;
    bool has_compact; /* with a right CRC of the board */
    struct taxel_batch_totals totals;
};

/* Whether a payload of that length goes with that type, and that type that way. */
bool oracle_allows(uint8_t type, uint8_t directions, size_t length);

/* Every frame of the stream, in order, and what was lost between them. */
void oracle_decode(struct oracle *oracle, const uint8_t *bytes, size_t size, uint8_t directions);

#endif
