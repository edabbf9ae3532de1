/* Coding of compact snapshots (protocol/SPEC.md): a prediction for each taxel, shared by board and host, and a range
 * coder for the counts. compact_model.c and compact_encode.c are linked into the board's image, compact_decode.c is
 * the host's.
 *
 * Integration (n taxels, counts as 2 bytes each; sensor/compact.c and compact_receiver.c do this with the protocol's
 * heads):
 *
 *     for (size_t i = 0; i < n; i++) {
 *         states[i] = taxel_compact_initial_state(key_counts[i], TAXEL_COMPACT_KEY_FRAME);
 *     }
 *     if (taxel_compact_encode(states, counts, n, coded, sizeof coded, &size)) { // board: false if it does not fit
 *         is_valid = taxel_compact_decode(states, n, coded, size, decoded);      // host
 *     }
 *     residual = taxel_compact_residual(states[0], decoded[0]);           // after an acknowledgement, on both sides:
 *     states[0] = taxel_compact_update(states[0], residual, updates);
 *
 * firmware/tests/test_integration_examples.c compiles and runs this example. */
#ifndef TAXEL_COMPACT_H
#define TAXEL_COMPACT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

/* Largest size in bytes of a compact snapshot of that many taxels, including its length byte. */
#define TAXEL_COMPACT_BUFFER_SIZE(taxels) (1u + ((TAXEL_COMPACT_OVERHEAD_PACKED + 2u * (taxels) + 3u) & ~3u))

#define TAXEL_COMPACT_UPDATES_MAX 15u

/* Prediction for one taxel: mean in 64ths of a count in the upper bits, level of the scale in the low bits. */
typedef uint32_t taxel_compact_state;

/* A probability interval in 2^-16, and the number of low bits of the count that are sent uncoded. size 0: an escape. */
struct taxel_compact_interval {
    uint32_t first;
    uint32_t size;
    uint8_t raw_bits;
};

/* compact_model.c */
/* State after a packed key frame; `format`: its format byte, which selects the initial scale. */
taxel_compact_state taxel_compact_initial_state(uint16_t count, uint8_t format);
uint16_t taxel_compact_centre(taxel_compact_state state);
uint8_t taxel_compact_raw_bits(taxel_compact_state state);
uint32_t taxel_compact_cumulative(taxel_compact_state state, uint32_t symbol);
struct taxel_compact_interval taxel_compact_interval(taxel_compact_state state, uint16_t count);
/* A key frame's count relative to its prediction, quantised to one byte as the board stores it. */
uint8_t taxel_compact_residual(taxel_compact_state state, uint16_t count);
/* State after an acknowledged key frame; updates: key frames since the last packed one, 1 to
 * TAXEL_COMPACT_UPDATES_MAX. */
taxel_compact_state taxel_compact_update(taxel_compact_state state, uint8_t residual, uint8_t updates);

/* compact_encode.c: counts (2 bytes each, as in a snapshot) into at most `capacity` bytes; false if they do not fit. */
bool taxel_compact_encode(const taxel_compact_state *states, const uint8_t *counts, size_t taxels, uint8_t *bytes,
                          size_t capacity, size_t *size);
/* Bits of the largest count, 1 to 16. */
uint8_t taxel_compact_width(const uint8_t *counts, size_t taxels);
size_t taxel_compact_packed_size(uint8_t width, size_t taxels);
void taxel_compact_pack(const uint8_t *counts, size_t taxels, uint8_t width, uint8_t *bytes);

/* compact_decode.c: bytes into counts. False: no encoder produces these bytes. */
bool taxel_compact_decode(const taxel_compact_state *states, size_t taxels, const uint8_t *bytes, size_t size,
                          uint16_t *counts);
void taxel_compact_unpack(const uint8_t *bytes, size_t taxels, uint8_t width, uint16_t *counts);

#endif
