/* What the fuzz targets share: reading a script from the input's bytes, invariants that end the run, and a CRC-32 of their
 * own, so that a target never checks the firmware's CRC with itself. */
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

/* An invariant: a finding if it does not hold, as a crash is. */
#define FUZZ_CHECK(holds)                                                                 \
    do {                                                                                  \
        if (!(holds)) {                                                                   \
            (void)fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #holds); \
            abort();                                                                      \
        }                                                                                 \
    } while (0)

/* The input, read from the front; behind its end stand zeros. */
struct fuzz_input {
    const uint8_t *bytes;
    size_t left;
};

static inline uint8_t fuzz_u8(struct fuzz_input *input)
{
    if (!input->left) {
        return 0;
    }
    input->left--;
    return *input->bytes++;
}

static inline uint16_t fuzz_u16(struct fuzz_input *input)
{
    const uint8_t low = fuzz_u8(input);
    return (uint16_t)(low | fuzz_u8(input) << 8);
}

/* Bytes from the input, as many as there are, at most `size`; the rest of `bytes` becomes zero. Returns how many came. */
static inline size_t fuzz_bytes(struct fuzz_input *input, uint8_t *bytes, size_t size)
{
    const size_t taken = size < input->left ? size : input->left;
    if (size) {
        memset(bytes, 0, size);
    }
    if (taken) {
        memcpy(bytes, input->bytes, taken);
        input->bytes += taken;
        input->left -= taken;
    }
    return taken;
}

/* A cheap sequence of bytes from a seed (the multiplier is Knuth's, MMIX), for what need not be mutated byte by byte. */
static inline uint8_t fuzz_next(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint8_t)(*state >> 56);
}

static uint32_t fuzz_crc_table[256];

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
