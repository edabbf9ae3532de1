/* The code of compact snapshots (protocol/SPEC.md): what board and host expect of each taxel, and a range coder between that
 * and the counts. compact_model.c and compact_encode.c are in the board's image, compact_decode.c is the host's. */
#ifndef TAXEL_COMPACT_H
#define TAXEL_COMPACT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

/* Bytes of a compact snapshot of that many taxels at most, its length byte included. */
#define TAXEL_COMPACT_BUFFER_SIZE(taxels) (1u + ((TAXEL_COMPACT_OVERHEAD_MIN + 2u * (taxels) + 3u) & ~3u))

#define TAXEL_COMPACT_UPDATES_MAX 15u

/* What is expected of one taxel: mean in 64ths of a count above, level of the scale in the low bits. */
typedef uint32_t taxel_compact_state;

/* A share of probability, in 2^-16, and the low bits of a count that are sent as they are. size 0: none, an escape. */
struct taxel_compact_interval {
    uint32_t first;
    uint32_t size;
    uint8_t raw_bits;
};

/* compact_model.c */
taxel_compact_state taxel_compact_begin(uint16_t count, uint8_t form);
uint16_t taxel_compact_centre(taxel_compact_state state);
uint8_t taxel_compact_raw_bits(taxel_compact_state state);
uint32_t taxel_compact_cumulative(taxel_compact_state state, uint32_t symbol);
struct taxel_compact_interval taxel_compact_interval(taxel_compact_state state, uint16_t count);
/* A candidate's count as the board remembers it in one byte, relative to its state. */
uint8_t taxel_compact_residual(taxel_compact_state state, uint16_t count);
/* The state after an acknowledged candidate; updates: candidates since the beginning, 1 to TAXEL_COMPACT_UPDATES_MAX. */
taxel_compact_state taxel_compact_learn(taxel_compact_state state, uint8_t residual, uint8_t updates);

/* compact_encode.c: counts (2 bytes each, as in a snapshot) into at most `capacity` bytes; false if they do not fit. */
bool taxel_compact_encode(const taxel_compact_state *states, const uint8_t *counts, size_t taxels, uint8_t *bytes,
                          size_t capacity, size_t *size);
uint8_t taxel_compact_width(const uint8_t *counts, size_t taxels);
size_t taxel_compact_packed_size(uint8_t width, size_t taxels);
void taxel_compact_pack(const uint8_t *counts, size_t taxels, uint8_t width, uint8_t *bytes);

/* Bytes into counts (compact_decode.c). False: no encoder makes these bytes. */
bool taxel_compact_decode(const taxel_compact_state *states, size_t taxels, const uint8_t *bytes, size_t size,
                          uint16_t *counts);
void taxel_compact_unpack(const uint8_t *bytes, size_t taxels, uint8_t width, uint16_t *counts);

#endif
