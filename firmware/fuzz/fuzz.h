/* Shared by the fuzz targets: a reader of the input's bytes, invariants that abort the run, and an independent
 * CRC-32, so that a target does not check the firmware's CRC against itself. */
#ifndef TAXEL_FUZZ_H
#define TAXEL_FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The entry that libFuzzer and standalone.c call. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

/* An invariant: a violation aborts the run and is a finding, like a crash. */
#define FUZZ_CHECK(condition) \
    do { \
        if (!(condition)) { \
            (void)fprintf(stderr, "%s:%d: violated: %s\n", __FILE__, __LINE__, #condition); \
            abort(); \
        } \
    } while (0)

/* The input, read from the front; zeros follow its end. */
struct fuzz_input {
    const uint8_t *bytes;
    size_t remaining;
};

/* Take one byte from the input; 0 after its end. */
static inline uint8_t fuzz_u8(struct fuzz_input *input)
{
    if (!input->remaining) {
        return 0;
    }
    input->remaining--;
    return *input->bytes++;
}

/* Take a little-endian 16-bit number from the input. */
static inline uint16_t fuzz_u16(struct fuzz_input *input)
{
    const uint8_t low = fuzz_u8(input);
    return (uint16_t)(low | fuzz_u8(input) << 8);
}

/* Copy at most `size` bytes of the input to `bytes`, and fill up with zeros. Returns the number of bytes copied. */
static inline size_t fuzz_bytes(struct fuzz_input *input, uint8_t *bytes, size_t size)
{
    const size_t taken = size < input->remaining ? size : input->remaining;
    if (size) {
        memset(bytes, 0, size);
    }
    if (taken) {
        memcpy(bytes, input->bytes, taken);
        input->bytes += taken;
        input->remaining -= taken;
    }
    return taken;
}

/* Next byte of a cheap pseudo-random sequence (multiplier of Knuth's MMIX), for bytes that need not be mutated one
 * by one. */
static inline uint8_t fuzz_next(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint8_t)(*state >> 56);
}

static uint32_t fuzz_crc_table[256];

/* Continue the CRC-32 `crc` (0 at the start) over `size` bytes. The table is computed at the first call. */
static inline uint32_t fuzz_crc32(uint32_t crc, const uint8_t *bytes, size_t size)
{
    if (!fuzz_crc_table[1]) {
        for (uint32_t b = 0; b < 256; b++) {
            uint32_t value = b;
            for (int bit = 0; bit < 8; bit++) {
                value = value & 1u ? value >> 1 ^ 0xEDB88320u : value >> 1;
            }
            fuzz_crc_table[b] = value;
        }
    }
    crc = ~crc;
    for (size_t i = 0; i < size; i++) {
        crc = crc >> 8 ^ fuzz_crc_table[(crc ^ bytes[i]) & 0xFFu];
    }
    return ~crc;
}

static inline void fuzz_put_u16(uint8_t *bytes, uint32_t value)
{
    bytes[0] = (uint8_t)value;
    bytes[1] = (uint8_t)(value >> 8);
}

static inline void fuzz_put_u32(uint8_t *bytes, uint32_t value)
{
    fuzz_put_u16(bytes, value);
    fuzz_put_u16(bytes + 2, value >> 16);
}

#endif
